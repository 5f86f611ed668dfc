"""A server of Motion JPEG over HTTP, for tests."""

import http.server
import queue
import socket
import socketserver
import threading
import time


class Server:
    """Serves pictures as Motion JPEG until it is killed. spoil: makes of each part what is sent."""

    def __init__(self, pictures, port=0, length=True, spoil=lambda part: part, rate=30.0):
        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(200)
                if self.path == "/page":
                    self.send_header("Content-Type", "text/html")
                    self.end_headers()
                    return
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
                self.end_headers()
                at = 0
                while server.alive:
                    picture = spoil(pictures[at % len(pictures)])
                    head = b"--frame\r\nContent-Type: image/jpeg\r\n"
                    if length:
                        head += b"Content-Length: %d\r\n" % len(picture)
                    try:
                        self.wfile.write(head + b"\r\n" + picture + b"\r\n")
                    except OSError:
                        return
                    at += 1
                    time.sleep(1.0 / rate)

            def log_message(self, *_):
                pass

        class Listening(socketserver.ThreadingMixIn, http.server.HTTPServer):
            daemon_threads = True
            allow_reuse_address = True

        server = self
        self.alive = True
        self._server = Listening(("127.0.0.1", port), Handler)
        self.port = self._server.server_address[1]
        self.address = f"http://127.0.0.1:{self.port}/stream"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def kill(self):
        self.alive = False
        self._server.shutdown()
        self._server.server_close()


class LiveServer:
    """Serves pictures that it takes at a fixed rate, all of them in order, also those that had to wait.

    Behind each picture, the time when it was taken follows (monotonic [s]), which `time_of` reads. stamps: also send it
    as X-Timestamp, by a clock that is this far ahead [s]. While `stalled` is set, nothing is sent.
    """

    RATE = 15.0

    def __init__(self, pictures, stamps=None):
        self.stalled = threading.Event()
        self._taken = queue.SimpleQueue()
        self._alive = True
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{self._listening.getsockname()[1]}/stream"
        self._stamps = stamps
        for work in (lambda: self._take(pictures), self._serve):
            threading.Thread(target=work, daemon=True).start()

    def _take(self, pictures):
        begun, count = time.monotonic(), 0
        while self._alive:
            time.sleep(max(begun + count / self.RATE - time.monotonic(), 0.0))
            now = time.monotonic()
            self._taken.put((now, pictures[count % len(pictures)] + f"{now:020.6f}".encode()))
            count += 1

    def _serve(self):
        try:
            connection, _ = self._listening.accept()
            with connection:
                connection.recv(4096)
                connection.sendall(
                    b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n\r\n"
                )
                while not self._taken.empty():
                    self._taken.get()
                while self._alive:
                    now, picture = self._taken.get()
                    while self.stalled.is_set():
                        time.sleep(0.005)
                    stamp = "" if self._stamps is None else f"X-Timestamp: {now + self._stamps:.6f}\r\n"
                    head = f"--frame\r\nContent-Length: {len(picture)}\r\n{stamp}\r\n"
                    connection.sendall(head.encode() + picture + b"\r\n")
        except OSError:
            return

    def kill(self):
        self._alive = False
        self._listening.close()


def time_of(picture):
    """When a picture of LiveServer was taken, monotonic [s]."""
    return float(picture[-20:])
