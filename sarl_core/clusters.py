"""A cluster of Dask: connecting to one that runs, or starting one on this machine.

Its processes are one more kind of `concurrent.futures.Executor`; whoever has more data than memory
also uses the client itself, which keeps what was worked out where it was worked out.
"""

from __future__ import annotations

import asyncio
import atexit
import logging
import re
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager
from importlib import import_module
from math import inf
from threading import Lock, Thread
from typing import Any, ParamSpec, TypeVar

from sarl_core.errors import InputError, SarlError, WorkError, needing_extras, quoted

VARIABLE = "SARL_CLUSTER"
"""The environment variable that names a cluster for the jobs of a dashboard."""
_LOCAL = re.compile(r"local:(?P<workers>\d{1,3})(?::(?P<memory>\d+(?:\.\d+)?\s*[kMGT]i?B))?")
_SECONDS = 10  # to wait for a scheduler, and for its first worker
_START_SECONDS = 60  # to wait for processes of this machine
_REFUSED_SECONDS = 3  # in which others who waited are told what was found
_ENDED = "the cluster ended in the middle of the work; run again"

Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")


def loss_text(error: Exception, lost: str) -> str:
    """The sentence for one of the `losses`.

    Args:
        error: It.
        lost: What is said where workers ended.

    Returns:
        That, or that the cluster did.
    """
    killed = type(error).__name__ == "KilledWorker"
    return lost if killed else _ENDED


class ClusterExecutor(Executor):
    """The processes of a cluster, as those of this machine."""

    loss_text = staticmethod(loss_text)

    def __init__(self, client: Any = None, again: Callable[[], Any] | None = None) -> None:
        """Take its client.

        Args:
            client: A ``distributed.Client``; None for one that `again` gives when it is needed.
            again: Gives another one, once its scheduler was lost; None where that is the end.
        """
        self.losses = losses()
        self._client, self._again, self._lock = client, again, Lock()
        self._refused: tuple[float, SarlError] = -inf, InputError("")

    def _connected(self) -> Any:
        """Its client; where the scheduler was lost, and may be back, another one.

        Raises:
            InputError: If it is not.
        """
        with self._lock:
            lost = self._client is None or self._client.status != "running"
            if lost and self._again is not None:
                refused, problem = self._refused
                if time.monotonic() - refused < _REFUSED_SECONDS:
                    raise problem
                try:
                    self._client = self._again()
                except SarlError as error:
                    self._refused = time.monotonic(), error
                    raise
            return self._client

    @property
    def workers(self) -> int:
        """How many calls it works on at once now: workers come and go.

        Raises:
            InputError: If the scheduler is lost.
            WorkError: If it is lost just now.
        """
        client = self._connected()
        try:
            threads = client.nthreads() if client.status == "running" else {}
        except (OSError, RuntimeError) as error:
            raise WorkError(_ENDED) from error
        if client.status != "running":
            raise WorkError(_ENDED)
        return max(1, sum(map(int, threads.values())))

    def submit(
        self,
        call: Callable[Arguments, Result],
        /,
        *arguments: Arguments.args,
        **named: Arguments.kwargs,
    ) -> Future[Result]:
        """See `Executor.submit`."""
        executor = self._connected().get_executor(pure=False)
        future: Future[Result] = executor.submit(call, *arguments, **named)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Let go of the cluster, which goes on."""
        self._again = None
        if self._client is not None:
            self._client.close()


@contextmanager
def cluster_executor(address: str) -> Iterator[ClusterExecutor]:
    """Processes of a cluster, for whoever takes an executor.

    Args:
        address: As of `cluster`.

    Yields:
        The executor.

    Raises:
        InputError: As `cluster`.
        WorkError: Likewise; or if the cluster cannot go on.
    """
    with cluster(address) as client, saying_losses():
        yield ClusterExecutor(client)


def lasting_executor(address: str) -> ClusterExecutor:
    """The same until this program ends, as for a server: it connects when there is work.

    Args:
        address: As of `cluster`.

    Returns:
        The executor; work is refused with an `InputError`, as by `cluster`.

    Raises:
        WorkError: If the extra "cluster" is not installed.
    """
    with needing_extras():
        import_module("distributed")
    stack = ExitStack()
    atexit.register(stack.close)

    def connected() -> Any:
        stack.close()  # of one that was lost, or is about to come back by itself
        return stack.enter_context(cluster(address))

    return ClusterExecutor(again=connected)


@contextmanager
def cluster(address: str) -> Iterator[Any]:
    """A client of a cluster, closed at the end; one on this machine ends with it.

    Args:
        address: Of a scheduler, as "tcp://scheduler:8786"; or "local:2" for two processes of this
            machine, "local:2:4GB" with so much memory each.

    Yields:
        A ``distributed.Client``.

    Raises:
        InputError: If the address is none, the scheduler cannot be reached, or it or its workers
            lack this package or have another version of it.
        WorkError: If the extra "cluster" is not installed.
    """
    with needing_extras():
        from distributed import Client, LocalCluster
    local = _LOCAL.fullmatch(address)
    if local is None and "://" not in address:
        raise InputError(
            f"{quoted(address)} is no cluster; give the address of a scheduler, as "
            "tcp://scheduler:8786, or local:2 for two processes of this machine"
        )
    if local is not None and not int(local["workers"]):
        raise InputError(f"{quoted(address)} has no process; give one or more, as local:2")
    # What the processes of a cluster say of themselves is not for whoever waits for rules.
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if local is not None:
        started = LocalCluster(
            n_workers=int(local["workers"]),
            threads_per_worker=1,
            memory_limit=local["memory"] or "auto",
            dashboard_address="127.0.0.1:0",  # a free port: two of these are no conflict
            silence_logs=logging.CRITICAL,
        )
        with started, Client(started) as client:
            _require_start(client, int(local["workers"]), address)
            yield client
        return
    _require_scheduler(address)
    try:
        client = Client(address, timeout=_SECONDS)
    except (OSError, ValueError) as error:
        raise _no_scheduler(address) from error
    with client:
        _require_same_package(client, address)
        yield client


def _require_scheduler(address: str) -> None:
    """Refuse an address at which nobody answers, or another server than a scheduler."""
    from distributed import Security

    arguments = Security().get_connection_args("client")
    if address.startswith("tls://") and arguments["ssl_context"] is None:
        raise InputError(
            f"{quoted(address)} asks for TLS, and no certificate is known here; name yours in "
            "Dask's configuration, under distributed.comm.tls"
        )
    answer: Future[bool] = Future()

    def ask() -> None:
        try:
            answer.set_result(asyncio.run(_is_scheduler(address, arguments)))
        except Exception as error:  # whatever can be made of what another server says
            answer.set_exception(error)

    # Of its own thread, for whoever calls from a loop that runs; and whose end nobody waits for.
    Thread(target=ask, daemon=True).start()
    try:
        answers = answer.result(_SECONDS)
    except Exception as error:
        raise _no_scheduler(address) from error
    if not answers:
        raise _no_scheduler(address)


async def _is_scheduler(address: str, arguments: dict[str, Any]) -> bool:
    from distributed import rpc

    # A client would wait for good where another server says nothing.
    async with asyncio.timeout(_SECONDS), rpc(address, connection_args=arguments) as server:
        return "workers" in await server.identity()


def _no_scheduler(address: str) -> InputError:
    return InputError(
        f"no scheduler answers at {quoted(address)}; check the address, and that it runs"
    )


def _begun() -> int:
    """Load what most work needs, and say how many bytes it takes to have that."""
    from distributed import get_worker

    for name in ("sarl_core.mining.distributed.mining", "pyarrow.parquet", "sklearn.tree"):
        import_module(name)
    return int(get_worker().monitor.get_process_memory())


def _require_start(client: Any, workers: int, address: str) -> None:
    """Refuse processes of this machine that would end, or wait, before they have done anything."""
    problem = InputError(
        f"the processes of {quoted(address)} do not start, as with too little memory; give each "
        "more, as local:2:1GB, or leave the memory out"
    )
    try:
        client.wait_for_workers(workers, timeout=_START_SECONDS)
        taken = client.submit(_begun, pure=False).result(_START_SECONDS)
    except TimeoutError as error:
        raise problem from error
    except losses() as error:
        raise problem from error
    # Dask lets a worker rest, for good, whose memory is nearly full.
    if any(2 * taken > one["memory_limit"] for one in client.scheduler_info()["workers"].values()):
        raise problem


def _require_same_package(client: Any, address: str) -> None:
    """Refuse a cluster that would work differently, or not at all."""

    def version() -> str:  # sent as it stands: whoever lacks the package could not look it up
        try:
            import sarl_core

            return sarl_core.__version__
        except Exception:  # a package of another name, or one that is only half there
            return ""

    own = version()

    def require(who: str, other: str) -> None:
        if not other:
            raise InputError(f"{who} lacks this package; install version {own} of it there")
        if other != own:
            raise InputError(
                f"{who} has version {other} of this package, and here is {own}; "
                "install the same one"
            )

    # It reads what it is sent before a worker does.
    require(f"the scheduler at {quoted(address)}", client.run_on_scheduler(version))
    try:
        client.wait_for_workers(1, timeout=_SECONDS)
    except TimeoutError as error:
        raise InputError(
            f"the scheduler at {quoted(address)} has no worker; start some: dask worker {address}"
        ) from error
    for worker, other in client.run(version).items():
        require(f"the worker {worker}", other)


def losses() -> tuple[type[Exception], ...]:
    """What a cluster raises when it cannot go on: workers ended, or all of it did."""
    from distributed import CancelledError, KilledWorker
    from distributed.client import ClosedClientError
    from distributed.comm.core import CommClosedError

    return KilledWorker, CommClosedError, CancelledError, ClosedClientError


def worked_out(futures: Sequence[Any], advance: Callable[[float], None]) -> Sequence[Any]:
    """Wait until all are worked out, where they are.

    Args:
        futures: Of a ``distributed.Client``.
        advance: Given the share that is done.

    Returns:
        The same.
    """
    from distributed import as_completed

    for done, future in enumerate(as_completed(futures), start=1):
        if future.status == "error":
            future.result()  # raises
        advance(done / len(futures))
    return futures


@contextmanager
def saying_losses() -> Iterator[None]:
    """Turn what a cluster raises when it cannot go on into one sentence."""
    try:
        yield
    except losses() as error:
        raise WorkError(
            loss_text(
                error,
                "several workers ended over the same piece of work, as when memory runs out; give "
                "them more memory, or write smaller row groups",
            )
        ) from error
