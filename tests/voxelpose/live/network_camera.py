"""A network camera on this machine: an HTTP server of one endless motion JPEG."""

import http.server
import threading

import cv2
import numpy as np


class NetworkCamera:
    """Delivers the same picture again and again.

    Attributes:
        picture: (H, W, 3) uint8 BGR, the one that is sent next; None: grey.
    """

    def __init__(
        self,
        port: int = 0,
        grey: int = 90,
        size: tuple[int, int] = (160, 120),
        picture: np.ndarray | None = None,
        interval_s: float = 0.04,
    ):
        if picture is None:
            picture = np.full((size[1], size[0], 3), grey, np.uint8)
        self.picture = picture
        over = self.over = threading.Event()
        camera = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=next")
                self.end_headers()
                try:
                    while not over.wait(interval_s):
                        jpeg = cv2.imencode(".jpg", camera.picture)[1].tobytes()
                        head = f"--next\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}"
                        self.wfile.write(head.encode() + b"\r\n\r\n" + jpeg + b"\r\n")
                except OSError:
                    pass

            def log_message(self, *_: object) -> None:
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self.server.daemon_threads = True
        self.port = self.server.server_address[1]
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/video.mjpg"

    def close(self) -> None:
        self.over.set()
        self.server.shutdown()
        self.server.server_close()
