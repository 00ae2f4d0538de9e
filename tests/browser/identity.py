"""A provider of identities (OpenID Connect) for tests: whoever is named has signed in."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import secrets
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

CLIENT = "dashboard"
_KEY = secrets.token_bytes(32)


def _text(content: bytes) -> str:
    return base64.urlsafe_b64encode(content).rstrip(b"=").decode()


def _signed(claims: Mapping[str, Any]) -> str:
    header = {"alg": "HS256", "typ": "JWT", "kid": "1"}
    head = ".".join(_text(json.dumps(part).encode()) for part in (header, claims))
    return f"{head}.{_text(hmac.digest(_KEY, head.encode(), hashlib.sha256))}"


@contextmanager
def identity_provider(
    people: Mapping[str, Mapping[str, object]], host: str = "127.0.0.1"
) -> Iterator[str]:
    """Serve on a free port.

    Args:
        people: By their ids, what the provider says of them.
        host: Address of this machine to serve at.

    Yields:
        Its address.
    """
    grants: dict[str, tuple[str, str]] = {}

    class IdentityHandler(BaseHTTPRequestHandler):
        @property
        def issuer(self) -> str:
            return f"http://{host}:{self.server.server_address[1]}"

        def log_message(self, *_: object) -> None:
            pass

        def answer(self, content: object, kind: str = "application/json") -> None:
            body = content.encode() if isinstance(content, str) else json.dumps(content).encode()
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def do_GET(self) -> None:
            address = urlsplit(self.path)
            asked = {name: values[0] for name, values in parse_qs(address.query).items()}
            if address.path == "/.well-known/openid-configuration":
                self.answer(
                    {
                        "issuer": self.issuer,
                        "authorization_endpoint": f"{self.issuer}/authorize",
                        "token_endpoint": f"{self.issuer}/token",
                        "jwks_uri": f"{self.issuer}/keys",
                        "response_types_supported": ["code"],
                        "subject_types_supported": ["public"],
                        "id_token_signing_alg_values_supported": ["HS256"],
                    }
                )
            elif address.path == "/keys":
                self.answer({"keys": [{"kty": "oct", "kid": "1", "k": _text(_KEY)}]})
            elif "person" in asked:
                code = secrets.token_urlsafe()
                grants[code] = (asked["person"], asked.get("nonce", ""))
                back = urlencode({"code": code, "state": asked["state"]})
                self.send_response(302)
                self.send_header("Location", f"{asked['redirect_uri']}?{back}")
                self.send_header("Content-Length", "0")
                self.end_headers()
            else:
                links = "".join(
                    f'<p><a href="/authorize?{urlencode({**asked, "person": person})}">{person}</a>'
                    for person in people
                )
                self.answer(f"<!doctype html><title>Who are you?</title>{links}", "text/html")

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"])).decode()
            person, nonce = grants.pop(parse_qs(body)["code"][0])
            now = int(time.time())
            claims = {
                **{"iss": self.issuer, "aud": CLIENT, "sub": person, "nonce": nonce},
                **{"iat": now, "exp": now + 600},
                **people[person],
            }
            token = {"access_token": secrets.token_urlsafe(), "token_type": "Bearer"}
            self.answer({**token, "expires_in": 600, "id_token": _signed(claims)})

    server = ThreadingHTTPServer((host, 0), IdentityHandler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://{host}:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()


def secrets_text(provider: str, dashboard: str) -> str:
    """What Streamlit's secrets say of the provider."""
    return f"""[auth]
redirect_uri = "{dashboard}/oauth2callback"
cookie_secret = "{secrets.token_hex(32)}"
client_id = "{CLIENT}"
client_secret = "no secret"
server_metadata_url = "{provider}/.well-known/openid-configuration"
"""
