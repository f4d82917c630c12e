"""Rerun's web page, passed on by a server of ours so that the browser lets it ask for nothing
outside this machine.

The page reports to its makers and asks for fonts, news and examples, whatever the executable was
told. A Content-Security-Policy is what a browser enforces; links that open connections before any
policy counts are left out of the page.
"""

from __future__ import annotations

import http.server
import re
import shutil
import threading
import urllib.error
import urllib.request
from typing import Any

OUTSIDE = re.compile(rb"<link\b[^>]*https?://[^>]*>")
"""A link of the page to another site."""
KEPT = ("Content-Type", "Content-Encoding", "rerun-final-length")
"""Headers that are passed on."""
PATIENCE = 60.0
"""For an answer of Rerun's own server [s]."""


def policy(data_port: int) -> str:
    """What the page may reach: what it came from, and its data.

    Parameters
    ----------
    data_port
        Of Rerun's server of data.
    """
    return (
        "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval';"
        " style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:;"
        " media-src data: blob:; worker-src 'self' blob:; base-uri 'none'; form-action 'none';"
        f" connect-src 'self' data: blob: http://127.0.0.1:{data_port}"
    )


class RerunPage:
    """Serves the page on 127.0.0.1 while the context is open.

    Parameters
    ----------
    port
        Of the page.
    rerun_port
        Of Rerun's own web server.
    data_port
        Of its server of data.

    Raises
    ------
    OSError
        If its port is taken.
    """

    def __init__(self, port: int, rerun_port: int, data_port: int):
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        source, allowed = f"http://127.0.0.1:{rerun_port}", policy(data_port)

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                try:
                    with opener.open(source + self.path, timeout=PATIENCE) as answer:
                        self._pass_on(answer)
                except urllib.error.HTTPError as error:
                    self.send_error(error.code)
                except OSError:
                    self.send_error(502, "Rerun does not serve its page yet: reload")

            def _pass_on(self, answer: Any) -> None:
                self.send_response(answer.status)
                for name in KEPT:
                    if value := answer.headers.get(name):
                        self.send_header(name, value)
                self.send_header("Content-Security-Policy", allowed)
                self.send_header("X-DNS-Prefetch-Control", "off")
                self.send_header("Referrer-Policy", "no-referrer")
                self.end_headers()
                if answer.headers.get_content_type() == "text/html":
                    self.wfile.write(OUTSIDE.sub(b"", answer.read()))
                else:
                    shutil.copyfileobj(answer, self.wfile, 1 << 20)

            def log_message(self, *_: Any) -> None:
                """Keep quiet about what was fetched."""

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    def __enter__(self) -> RerunPage:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()
