"""The connections of a page: each one ends its own side first, so that its last answer is read."""

import asyncio
import contextlib
from typing import Any, cast

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

#: Seconds for which a connection that has ended its own side still reads.
_PATIENCE = 2.0


class _Transport:
    """A transport that ends its own side when it is closed, and is closed by its peer, by ``end`` or after a time."""

    def __init__(self, transport: asyncio.Transport) -> None:
        self._transport, self.is_ended, self.waits = transport, False, True
        self._timer: asyncio.TimerHandle | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def is_closing(self) -> bool:
        """Return True if nothing more is written."""
        return self.is_ended or self._transport.is_closing()

    def close(self) -> None:
        """End the own side of the connection, and read on."""
        if self.is_closing():
            return
        if not self.waits:
            self.end()
            return
        self.is_ended = True
        self._timer = asyncio.get_running_loop().call_later(_PATIENCE, self.end)
        # the end of the peer's side is read like its data
        self._transport.resume_reading()
        try:
            self._transport.write_eof()
        except OSError:  # the peer has gone
            self.end()

    def end(self) -> None:
        """Close both sides of the connection."""
        self.is_ended = True
        if self._timer:
            self._timer.cancel()
        self._transport.close()


class Connection(H11Protocol):
    """A connection over which a refusal is read, although a part of the request was not.

    The operating system resets a connection that is closed while a part of the request is unread or still on its way. A
    reset discards all that the browser has not read yet, so that the browser would report a failed connection instead
    of the refusal. Therefore a connection that ends first sends its own end. Then it drops all that still arrives,
    until the browser closes its side, but not longer than two seconds.
    """

    _own: _Transport

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin a connection."""
        self._own = _Transport(transport)
        super().connection_made(cast(asyncio.Transport, self._own))

    def connection_lost(self, exc: Exception | None) -> None:
        """Finish a connection that both sides have ended, or that has broken."""
        super().connection_lost(exc)
        self._own.end()

    def data_received(self, data: bytes) -> None:
        """Take data of a request, or drop them after the own end."""
        if not self._own.is_ended:
            super().data_received(data)

    def send_400_response(self, msg: str) -> None:
        """Refuse data that are not HTTP.

        The application answers no request that such data are a part of. If it has answered already, the connection only
        ends, because a second answer would belong to no request.
        """
        if self.cycle:
            self.cycle.disconnected = True
        with contextlib.suppress(h11.LocalProtocolError):
            super().send_400_response(msg)
        self.transport.close()

    def shutdown(self) -> None:
        """End a connection of a server that stops, after the answer that is under way. It waits for no browser."""
        self._own.waits = False
        if self._own.is_ended:
            self._own.end()
        else:
            super().shutdown()
