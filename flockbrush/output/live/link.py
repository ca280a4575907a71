"""The WebSocket server of the live link: clients, their queues and requests, in its own thread.

No client can hold up the herd or another client.  Each has one place for the newest frame, which a newer one replaces,
and a bounded list of answers; who does not read for `STALL` seconds is cut off.
"""

from __future__ import annotations

import asyncio
import errno
import hmac
import json
import logging
import queue
import secrets
import socket
import threading
from collections import deque
from http import HTTPStatus
from urllib.parse import parse_qs, urlsplit

from flockbrush.engine import limits
from flockbrush.engine.files import refused
from flockbrush.output.live.messages import RequestError, read_request

STALL = 10.0  # s without reading after which a client is cut off
EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # what listens on all addresses, and one that leads there
GREETING = 5.0  # s for a client to say what it wants
_SEND_BUFFER = 1 << 18  # bytes that the system keeps for a client: more of them would be old frames


class Client:
    """A connected client program."""

    def __init__(self, connection):
        self.connection = connection
        self.texts: deque[str] = deque()
        self.frame: bytes | None = None
        self.news = asyncio.Event()
        self.lost = False

    def tell(self, text):
        """Send a text; a client with too many unread messages is disconnected."""
        if len(self.texts) >= limits.LIVE_ANSWERS:
            self.lost = True
        else:
            self.texts.append(text)
        self.news.set()

    def show(self, frame):
        """Send a frame; it replaces a frame that is still waiting."""
        self.frame = frame
        self.news.set()

    async def send_all(self):
        """Send what comes, until the connection ends."""
        while not self.lost:
            await self.news.wait()
            self.news.clear()
            while self.texts and not self.lost:
                await asyncio.wait_for(self.connection.send(self.texts.popleft()), STALL)
            frame, self.frame = self.frame, None
            if frame is not None:
                await asyncio.wait_for(self.connection.send(frame), STALL)


class Link:
    """A WebSocket server.  `start` it, `show` frames and take `requests`; every method but `start` returns at once.

    Parameters
    ----------
    host, port : str, int
        0: any free port.
    greeting : function () -> list of str
        What a new client is told first; called on the server's thread.
    token : str, optional
        What a client must know; made up by default.
    """

    def __init__(self, host, port, greeting, token=None):
        self.host, self.port, self.greeting = host, port, greeting
        self.token = token or secrets.token_urlsafe(18)
        # queue.Queue of (Client, Request); at most `limits.LIVE_WAITING`
        self.requests: queue.Queue = queue.Queue(limits.LIVE_WAITING)
        self.clients: set[Client] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="live link", daemon=True)
        self._server = None

    @property
    def address(self):
        """The address to connect to, with the token; of a link on all addresses, for this machine."""
        host = EVERYWHERE.get(self.host, self.host)
        host = f"[{host}]" if ":" in host else host
        return f"ws://{host}:{self.port}/?token={self.token}"

    def start(self):
        """Listen; ProblemsError when the port is taken or the package `websockets` is missing."""
        try:
            from websockets.asyncio.server import serve
        except ImportError:
            text = 'the live link needs the package websockets: pip install "flockbrush[live]"'
            raise refused("serve", text) from None
        listening = self._listen()
        self.port = listening.getsockname()[1]
        self._thread.start()
        quiet = logging.getLogger("flockbrush.live")
        quiet.addHandler(logging.NullHandler())
        quiet.propagate = False

        async def begin():
            return await serve(
                self._serve,
                sock=listening,
                process_request=self._admit,
                compression=None,
                max_size=int(limits.LIVE_MESSAGE),
                max_queue=4,
                open_timeout=GREETING,
                ping_interval=STALL,
                ping_timeout=STALL,
                close_timeout=1.0,
                logger=quiet,
                server_header=None,
            )

        self._server = asyncio.run_coroutine_threadsafe(begin(), self._loop).result()

    def _listen(self):
        where = f"{self.host}:{self.port}"
        try:
            family = socket.getaddrinfo(self.host, self.port, type=socket.SOCK_STREAM)[0][0]
            return socket.create_server((self.host, self.port), family=family)
        except OverflowError:
            raise refused(where, "a port must be a number from 0 to 65535") from None
        except socket.gaierror as error:
            raise refused(where, f"this machine does not have this address: {error.strerror}") from None
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                text = "this port is in use by another program; choose another port, or --port 0 for any free port"
                raise refused(where, text) from None
            raise refused(where, f"cannot listen on this address: {error.strerror or error}") from None

    def close(self):
        """Close all connections and stop listening."""
        if self._server is None:
            return

        async def end():
            self._server.close()
            await self._server.wait_closed()

        try:
            asyncio.run_coroutine_threadsafe(end(), self._loop).result(timeout=2 * STALL)
        finally:
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(STALL)
            self._loop.close()

    # from the thread of the simulation ------------------------------------------------------

    def show(self, frame: bytes):
        """Send a frame to every client that can take one."""
        self._loop.call_soon_threadsafe(self._all, Client.show, frame)

    def tell_all(self, text: str):
        """Send a text to every client."""
        self._loop.call_soon_threadsafe(self._all, Client.tell, text)

    def tell(self, client: Client, text: str):
        """Send a text to one client."""
        self._loop.call_soon_threadsafe(client.tell, text)

    # on the thread of the server --------------------------------------------------------------

    def _all(self, deed, what):
        for client in self.clients:
            deed(client, what)

    def _admit(self, connection, request):
        """None, or the response that rejects this client."""
        given = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
        if not hmac.compare_digest(given.encode(), self.token.encode()):
            text = "the token is wrong or missing: connect to the address that flockbrush serve printed\n"
            return connection.respond(HTTPStatus.UNAUTHORIZED, text)
        if len(self.clients) >= limits.LIVE_CLIENTS:
            return connection.respond(
                HTTPStatus.SERVICE_UNAVAILABLE, f"the maximum of {limits.LIVE_CLIENTS.text} is reached\n"
            )
        return None

    async def _serve(self, connection):
        """A client from its first to its last message."""
        from websockets.exceptions import ConnectionClosed

        ours = connection.transport.get_extra_info("socket")
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        client = Client(connection)
        for text in self.greeting():
            client.tell(text)
        self.clients.add(client)
        sending = asyncio.create_task(client.send_all())
        hearing = asyncio.create_task(self._hear(client))
        try:
            await asyncio.wait((sending, hearing), return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.clients.discard(client)
            for task in (sending, hearing):
                task.cancel()
            ended = await asyncio.gather(sending, hearing, return_exceptions=True)
            if _is_stuck(client, ended):
                connection.transport.abort()
        for error in ended:
            if isinstance(error, Exception) and not isinstance(error, ConnectionClosed | TimeoutError):
                raise error

    async def _hear(self, client):
        """Read what a client asks, no faster than is allowed."""
        pause = 1.0 / limits.LIVE_MESSAGES
        clock = asyncio.get_running_loop().time
        credit, before = float(limits.LIVE_MESSAGES), clock()
        async for message in client.connection:
            now = clock()
            credit, before = min(credit + (now - before) / pause, float(limits.LIVE_MESSAGES)) - 1, now
            self._take(client, message)
            if credit < 1:
                await asyncio.sleep(pause)

    def _take(self, client, message):
        try:
            request = read_request(message)
            self.requests.put_nowait((client, request))
        except RequestError as error:
            client.tell(json.dumps({"type": "error", "id": error.id, "message": str(error)}))
        except queue.Full:
            text = f"{limits.LIVE_WAITING.text} are already waiting; send fewer requests"
            client.tell(json.dumps({"type": "error", "id": request.id, "message": text}))


def _is_stuck(client, ended):
    """Whether a client has stopped reading, so that the connection must be aborted."""
    return client.lost or any(isinstance(error, TimeoutError) for error in ended)
