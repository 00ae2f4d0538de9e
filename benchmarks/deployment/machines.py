"""Three machines on one: the dashboard, its database and the proxy, each with a network of its own.

What the compose file says of them is read from it, but for the images: Debian's PostgreSQL and
nginx stand for those of the other two.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import ssl
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from benchmarks.deployment.container import Image

DOMAIN = "sarl.example.org"
HOST = "10.77.0.1"  # of this machine, on the net that it shares with the three
ADDRESSES = {"dashboard": "10.77.0.2", "database": "10.77.0.3", "proxy": "10.77.0.4"}
_BRIDGE = "sarlbridge"
_POSTGRES = Path("/usr/lib/postgresql")


@dataclass(frozen=True)
class Deployment:
    """What runs.

    Attributes:
        folder: Where logs and files are.
        image: Of the dashboard.
        service: What the compose file says of the dashboard.
        authority: Certificate of who has signed the proxy's.
    """

    folder: Path
    image: Image
    service: Mapping[str, Any]
    authority: Path

    @property
    def log(self) -> Path:
        """What the dashboard has said."""
        return self.folder / "dashboard.log"

    @property
    def trust(self) -> ssl.SSLContext:
        """For connections to the proxy."""
        return ssl.create_default_context(cafile=str(self.authority))

    @contextmanager
    def dashboard(self) -> Iterator[subprocess.Popen[bytes]]:
        """The dashboard, as the container file and the compose file say."""
        with self.log.open("ab") as log:
            process = subprocess.Popen(
                _inside("dashboard", _contained(self)), stdout=log, stderr=subprocess.STDOUT
            )
            try:
                _until_answers(f"http://{ADDRESSES['dashboard']}:8501/health", process)
                yield process
            finally:
                process.terminate()
                process.wait(60)

    def health(self) -> str:
        """What the container's own check holds against it, "" for nothing."""
        check = _contained(self, self.image.healthcheck)
        done = subprocess.run(_inside("dashboard", check), capture_output=True, text=True)
        return done.stderr.strip() if done.returncode else ""


def variables(text: str, known: Mapping[str, str]) -> str:
    """A value of the compose file with what ``.env`` says in place of its names."""
    return re.sub(r"\$\{(\w+)[^}]*\}", lambda found: known[found[1]], text)


@contextmanager
def deployed(example: Path, image: Image, folder: Path, secrets: str) -> Iterator[Deployment]:
    """The database and the proxy run on the net, and the dashboard can be started.

    Args:
        example: Folder of the compose file, the settings and the proxy's.
        image: What the container file makes.
        folder: Empty folder for everything that is written.
        secrets: What stands in ``secrets.toml``.

    Yields:
        What runs.
    """
    known = {"DATABASE_PASSWORD": os.urandom(24).hex()}
    compose = yaml.safe_load(variables((example / "compose.yaml").read_text(), known))
    user, group = image.account
    for name in ("server.toml", "nginx.conf"):
        shutil.copy(example / name, folder / name)
    own = folder / "secrets.toml"
    own.write_text(secrets)
    own.chmod(0o600)
    os.chown(own, user, group)
    authority = _certificates(folder / "tls")
    names = {**ADDRESSES, DOMAIN: ADDRESSES["proxy"]}
    (folder / "hosts").write_text(
        "127.0.0.1 localhost\n" + "".join(f"{at} {name}\n" for name, at in names.items())
    )
    deployment = Deployment(folder, image, compose["services"]["dashboard"], authority)
    with _database(folder, compose["services"]["database"]["environment"]), _proxy(folder):
        yield deployment


def _contained(deployment: Deployment, command: Sequence[str] = ()) -> list[str]:
    """How the dashboard's process, or another one beside it, begins within its container."""
    image, service, folder = deployment.image, deployment.service, deployment.folder
    user, group = image.account
    arguments = ["bwrap", "--ro-bind" if service["read_only"] else "--bind", str(image.root), "/"]
    arguments += ["--proc", "/proc", "--dev", "/dev"]
    (image.root / "etc" / "hosts").touch()  # what engines make before the root is read-only
    arguments += ["--ro-bind", str(folder / "hosts"), "/etc/hosts"]
    # Engines give 64 MB of memory that processes share.
    arguments += ["--perms", "1777", "--size", str(64 << 20), "--tmpfs", "/dev/shm"]
    place, _, mib = service["tmpfs"].removesuffix("m").partition(":size=")
    arguments += ["--perms", "1777", "--size", str(int(mib) << 20), "--tmpfs", place]
    for line in sorted(service["volumes"], key=lambda line: line.startswith(".")):
        source, _, rest = line.partition(":")
        place, _, mode = (rest or source).partition(":")
        if source.startswith("./"):
            kind = "--ro-bind" if mode == "ro" else "--bind"
            arguments += [kind, str(folder / source), place]
        else:
            arguments += ["--bind", str(_volume(image, folder, place)), place]
    for name, value in {**image.environment, **service["environment"]}.items():
        arguments += ["--setenv", name, str(value)]
    assert service["cap_drop"] == ["ALL"]  # bwrap keeps those that changing the user takes
    arguments += ["--cap-drop", "ALL", "--cap-add", "CAP_SETUID", "--cap-add", "CAP_SETGID"]
    arguments += ["--cap-add", "CAP_SETPCAP", "--unshare-pid", "--die-with-parent"]
    arguments += ["--chdir", image.folder, "/usr/bin/setpriv", "--reuid", str(user)]
    arguments += ["--regid", str(group), "--clear-groups", "--bounding-set=-all", "--no-new-privs"]
    return ["env", "--ignore-environment", *arguments, *(command or image.command)]


def _volume(image: Image, folder: Path, place: str) -> Path:
    """A volume, which begins as what the image has there."""
    volume = folder / "volumes" / place.strip("/").replace("/", "_")
    if not volume.exists():
        volume.parent.mkdir(exist_ok=True)
        subprocess.run(["cp", "--archive", image.root / place.strip("/"), volume], check=True)
    return volume


def _inside(machine: str, arguments: Sequence[str]) -> list[str]:
    return ["ip", "netns", "exec", machine, *arguments]


@contextmanager
def network() -> Iterator[None]:
    """A net that this machine shares with the three."""

    def ip(*words: str) -> None:
        subprocess.run(["ip", *words], check=True)

    ip("link", "add", _BRIDGE, "type", "bridge")
    try:
        ip("addr", "add", f"{HOST}/24", "dev", _BRIDGE)
        ip("link", "set", _BRIDGE, "up")
        for name, address in ADDRESSES.items():
            outer = f"sarl{name[:8]}"
            ip("netns", "add", name)
            ip("link", "add", outer, "type", "veth", "peer", "name", "eth0", "netns", name)
            ip("link", "set", outer, "master", _BRIDGE, "up")
            ip("-n", name, "addr", "add", f"{address}/24", "dev", "eth0")
            for device in ("lo", "eth0"):
                ip("-n", name, "link", "set", device, "up")
        yield
    finally:
        for name in ADDRESSES:
            subprocess.run(["ip", "netns", "delete", name], stderr=subprocess.DEVNULL)
        ip("link", "delete", _BRIDGE)


@contextmanager
def _database(folder: Path, environment: Mapping[str, str]) -> Iterator[None]:
    programs = max(_POSTGRES.glob("*/bin"), key=lambda path: int(path.parent.name))
    data, password = folder / "database", folder / "password"
    as_postgres = ["setpriv", "--reuid", "postgres", "--regid", "postgres", "--init-groups"]
    data.mkdir()
    password.write_text(environment["POSTGRES_PASSWORD"])
    for path in (data, password):
        shutil.chown(path, "postgres", "postgres")
    user, name = environment["POSTGRES_USER"], environment["POSTGRES_DB"]
    subprocess.run(
        [
            *(*as_postgres, str(programs / "initdb"), "--pgdata", str(data), "--username", user),
            *("--pwfile", str(password), "--auth", "scram-sha-256"),
        ],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    with (data / "pg_hba.conf").open("a") as rules:
        rules.write("host all all all scram-sha-256\n")
    with (folder / "database.log").open("wb") as log:
        server = subprocess.Popen(
            _inside(
                "database",
                [*as_postgres, str(programs / "postgres"), "-D", str(data), "-h", "*", "-k", ""],
            ),
            stdout=log,
            stderr=subprocess.STDOUT,
        )
    try:
        sign_in = {**os.environ, "PGPASSWORD": environment["POSTGRES_PASSWORD"]}
        to = ["--host", ADDRESSES["database"], "--username", user]
        for _ in range(100):
            if not subprocess.run(["pg_isready", *to], capture_output=True).returncode:
                break
            time.sleep(0.2)
        subprocess.run(["createdb", *to, name], env=sign_in, check=True)
        yield
    finally:
        server.send_signal(signal.SIGINT)
        server.wait(30)


@contextmanager
def _proxy(folder: Path) -> Iterator[None]:
    log = folder / "nginx"
    log.mkdir()
    contained = [
        *("bwrap", "--dev-bind", "/", "/", "--tmpfs", "/run", "--tmpfs", "/var/lib/nginx"),
        *("--bind", str(log), "/var/log/nginx", "--ro-bind", str(folder / "hosts"), "/etc/hosts"),
        *("--tmpfs", "/etc/nginx", "--unshare-pid", "--proc", "/proc", "--die-with-parent"),
    ]
    for name in ("nginx.conf", "mime.types"):
        contained += ["--ro-bind", f"/etc/nginx/{name}", f"/etc/nginx/{name}"]
    contained += ["--ro-bind", str(folder / "nginx.conf"), "/etc/nginx/conf.d/default.conf"]
    contained += ["--ro-bind", str(folder / "tls"), "/etc/nginx/tls"]
    server = subprocess.Popen(_inside("proxy", [*contained, "nginx", "-g", "daemon off;"]))
    try:
        time.sleep(1)
        if server.poll() is not None:
            raise RuntimeError(f"nginx ended at once; see {log}")
        yield
    finally:
        server.terminate()
        server.wait(30)


def _certificates(folder: Path) -> Path:
    """The proxy's certificate, and that of who has signed it."""
    folder.mkdir()

    def openssl(*words: str) -> None:
        subprocess.run(["openssl", *words], cwd=folder, check=True, capture_output=True)

    key = ["-newkey", "rsa:2048", "-nodes", "-days", "2"]
    openssl("req", "-x509", *key, "-subj", "/CN=test", "-keyout", "ca.key", "-out", "ca.crt")
    (folder / "names").write_text(f"subjectAltName=DNS:{DOMAIN}\n")
    openssl(
        *("req", "-newkey", "rsa:2048", "-nodes", "-subj", f"/CN={DOMAIN}"),
        *("-keyout", "server.key", "-out", "server.csr"),
    )
    openssl(
        *("x509", "-req", "-in", "server.csr", "-CA", "ca.crt", "-CAkey", "ca.key"),
        *("-CAcreateserial", "-days", "2", "-extfile", "names", "-out", "server.crt"),
    )
    return folder / "ca.crt"


def _until_answers(address: str, process: subprocess.Popen[bytes]) -> None:
    for _ in range(600):
        if process.poll() is not None:
            raise RuntimeError("the dashboard ended at once; see dashboard.log")
        try:
            urllib.request.urlopen(address, timeout=5).close()
            return
        except (urllib.error.URLError, ConnectionError, TimeoutError):
            time.sleep(0.2)
    raise RuntimeError(f"{address} does not answer")
