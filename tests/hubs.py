"""Serial cables and CAN buses without kernel support: hubs that forward received data to all other ends."""

import os
import select
import socket
import threading
import time
import tty
from contextlib import suppress


class _Hub:
    """One thread that serves until it is closed."""

    def __init__(self):
        self._cut, self._knife = os.pipe()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def close(self):
        os.write(self._knife, b"x")
        self._thread.join()
        os.close(self._cut)
        os.close(self._knife)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class Cable(_Hub):
    """Two pseudo terminals that forward received bytes to each other; `ends` are their ports."""

    def __init__(self):
        pairs = [os.openpty() for _ in range(2)]
        for _, end in pairs:
            tty.setraw(end)
        self.ends = [os.ttyname(end) for _, end in pairs]
        self._ends = [end for _, end in pairs]  # kept open, so that a client may close its own
        self._inner = [inner for inner, _ in pairs]
        super().__init__()

    def _serve(self):
        while True:
            ready = select.select([*self._inner, self._cut], [], [])[0]
            if self._cut in ready:
                return
            for inner in ready:
                data = self._passed(inner, os.read(inner, 4096))
                for other in self._inner if data else ():
                    if other != inner:
                        os.write(other, data)

    def _passed(self, inner, data):
        return data

    def say(self, end, data):
        """Let these bytes come to the program at one end."""
        os.write(self._inner[end], data)

    def close(self):
        super().close()
        for end in (*self._ends, *self._inner):
            os.close(end)


class SlcanHub(Cable):
    """Serial adapters of the LAWICEL kind, which forward only whole frames."""

    def __init__(self):
        self._begun = {}
        super().__init__()

    def _passed(self, inner, data):
        *lines, self._begun[inner] = (self._begun.get(inner, b"") + data).split(b"\r")
        return b"".join(line + b"\r" for line in lines if line.startswith((b"t", b"T")))


class SocketcandHub(_Hub):
    """A socketcand with one bus of any name; `port` is where it listens, on this computer only."""

    def __init__(self, port=0):
        self._server = socket.create_server(("127.0.0.1", port))
        self.port = self._server.getsockname()[1]
        self._clients = {}
        super().__init__()

    def _serve(self):
        while True:
            ready = select.select([self._server, self._cut, *self._clients], [], [])[0]
            if self._cut in ready:
                return
            if self._server in ready:
                client, _ = self._server.accept()
                client.sendall(b"< hi >")
                self._clients[client] = [False, b""]
            for client in set(ready) & set(self._clients):
                self._take(client)

    def _take(self, client):
        state = self._clients[client]
        try:
            data = client.recv(4096)
        except ConnectionError:
            data = b""
        if not data:
            client.close()
            del self._clients[client]
            return
        *messages, state[1] = (state[1] + data).split(b">")
        for message in messages:
            words = message.strip(b"< ").split()
            if words[0] in (b"open", b"rawmode"):
                state[0] = words[0] == b"rawmode"
                client.sendall(b"< ok >")
            elif words[0] == b"send":
                payload = b"".join(b"%02x" % int(word, 16) for word in words[3:])
                frame = b"< frame %s %.6f %s >" % (words[1], time.time(), payload)
                for other, (is_raw, _) in self._clients.items():
                    if other is not client and is_raw:
                        with suppress(ConnectionError):  # it may just have left
                            other.sendall(frame)

    def close(self):
        super().close()
        for client in (*self._clients, self._server):
            client.close()
