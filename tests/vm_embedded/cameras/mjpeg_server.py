"""A server of Motion JPEG over HTTP, for tests."""

import http.server
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
