"""The web server of the view: viser, an optional package, bound to this machine and closed to
pages of other origins.

viser serves every page with its own title, and lets everybody in. So each request is looked at
before viser sees it: a stranger is refused, and a page whose address lacks the token says so.
"""

from __future__ import annotations

import contextlib
import hmac
import html
import http
import importlib
import io
import ipaddress
import logging
import secrets
import socket
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import ModuleType
from typing import Any
from urllib.parse import parse_qs, urlsplit

from dart_skill.common.extras import remedy

FULL_ADDRESS = "the token is not in it: 'dart-skill status' prints the whole address"
"""What is told to a program that opens a websocket without the token."""


class ViewUnavailable(RuntimeError):
    """The view cannot be served here; the message says what to do."""


def load_viser() -> ModuleType:
    """The module viser.

    Raises
    ------
    ViewUnavailable
        Names the package to install.
    """
    try:
        return importlib.import_module("viser")
    except ImportError as error:
        raise ViewUnavailable(
            f"the live view needs the package viser, which is not there ({error}):"
            f" {remedy('viser')}"
        ) from error


def open_server(
    host: str = "127.0.0.1", port: int = 0, title: str = "dart_skill", token: str = ""
) -> Any:
    """A running viser.ViserServer, empty, for `Scene` and `Panel`.

    Stop it with its method `stop`.

    Parameters
    ----------
    host
        Address to listen on.
    port
        0 for any free one, else that one and no other.
    token
        Only who has it is let in (`with_token`); empty: everybody.
    title
        Of the page.

    Raises
    ------
    ViewUnavailable
        If viser is missing or the port is taken.
    """
    viser = load_viser()
    _check_free(host, port)
    logging.getLogger("websockets.server").addFilter(_without_traceback)
    logging.getLogger("asyncio").addFilter(_unusable_in_a_line)
    # viser prints a panel; our callers say it in their own way
    with contextlib.redirect_stdout(io.StringIO()), _asked_first(title, token):
        server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
    # any client may ask viser for a public address; an arm is not to be had from outside
    server.request_share_url = _never_share
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
    return server


def url_of(server: Any) -> str:
    """Where a browser on this machine finds the page.

    Parameters
    ----------
    server
        From `open_server`.
    """
    host = server.get_host()
    host = "127.0.0.1" if host in ("0.0.0.0", "::", "") else host
    return f"http://{f'[{host}]' if ':' in host else host}:{server.get_port()}"


def new_token() -> str:
    """A secret for the address of a page, which cannot be guessed."""
    return secrets.token_urlsafe(16)


def with_token(url: str, token: str) -> str:
    """The address of a page, of which the browser opens the websocket with the token: viser takes
    its address as a parameter.

    Parameters
    ----------
    url
        Without the token.
    """
    return f"{url}/?websocket={url.replace('http', 'ws', 1)}/{token}"


def has_token(path: str, token: str) -> bool:
    """Whether a websocket was opened with the token, if there is one."""
    return not token or hmac.compare_digest(
        path.partition("?")[0].strip("/").encode(), token.encode()
    )


def is_own_page(headers: Mapping[str, str]) -> bool:
    """Whether a websocket was opened by a page of this server, or by a program that is no browser.

    Browsers let every page open a websocket to every address, so a page on the web could move the
    arm. Its `Origin` gives it away; and a name that another person gave to this machine's address
    (DNS rebinding) is neither an address nor one of its own names.
    """
    origin = headers.get("Origin")
    if origin is None:
        return True
    page, asked = urlsplit(origin), urlsplit(f"//{headers.get('Host', '')}")
    return page.netloc == asked.netloc and _is_own_name(asked.hostname or "")


def _is_own_name(name: str) -> bool:
    if name in ("localhost", socket.gethostname().lower(), socket.getfqdn().lower()):
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


@contextlib.contextmanager
def _asked_first(title: str, token: str) -> Iterator[None]:
    """A server of viser that is made meanwhile asks `_answer` first: viser has no way to say that."""
    websockets: Any = importlib.import_module("websockets.asyncio.server")
    serve = websockets.serve

    def serve_asked_first(*given: Any, process_request: Callable, **more: Any) -> Any:
        return serve(
            *given, process_request=partial(_answer, process_request, title, token), **more
        )

    websockets.serve = serve_asked_first
    try:
        yield
    finally:
        websockets.serve = serve


def _answer(viser_answers: Callable, title: str, token: str, connection: Any, request: Any) -> Any:
    """The answer to a request: None opens a websocket."""
    if request.headers.get("Upgrade") == "websocket":
        if not is_own_page(request.headers):
            return connection.respond(
                http.HTTPStatus.FORBIDDEN, "pages of other origins do not move this arm\n"
            )
        if not has_token(request.path, token):
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{FULL_ADDRESS}\n")
        return viser_answers(connection, request)
    page = urlsplit(request.path)
    if page.path not in ("/", "/index.html"):
        return _file(viser_answers, connection, request)
    websocket = parse_qs(page.query).get("websocket", [""])[0]
    if not has_token(urlsplit(websocket).path, token):
        return _as_page(connection, http.HTTPStatus.FORBIDDEN, _refusal(title, websocket))
    del request.headers["Accept-Encoding"]  # the title stands in the text
    text = viser_answers(connection, request).body.decode()
    title_tag = f"<title>{html.escape(title)}</title>"
    return _as_page(
        connection, http.HTTPStatus.OK, text.replace("<title>Viser</title>", title_tag, 1)
    )


def _file(viser_answers: Callable, connection: Any, request: Any) -> Any:
    """A file of the page; 404 for what cannot be the name of a file, where viser answers with 500."""
    try:
        return viser_answers(connection, request)
    except (OSError, ValueError):
        return connection.respond(http.HTTPStatus.NOT_FOUND, "NOT FOUND\n")


def _as_page(connection: Any, status: http.HTTPStatus, text: str) -> Any:
    response = connection.respond(status, text)
    del response.headers["Content-Type"]
    response.headers["Content-Type"] = "text/html; charset=utf-8"
    return response


def _refusal(title: str, websocket: str) -> str:
    """The page for who has not the token: what is missing, and where it is."""
    missing = (
        "The token in this address is not that of the page: it is new each time the page is served."
        if websocket
        else "This address lacks the token, without which nobody may look at the arm or move it."
    )
    name = html.escape(title)
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{name}</title>
<style>:root {{ color-scheme: light dark; }} body {{ font: 1.1rem/1.5 sans-serif; max-width: 36rem;
  margin: 4rem auto; padding: 0 1rem; }} code {{ font-size: 1.05em; }}</style></head>
<body><h1>{name}</h1>
<p>{missing}</p>
<p>Type <code>dart-skill status</code> where the arm runs: it prints the whole address. So did
<code>dart-skill up --viewer</code>, or the viewer, when it started.</p></body></html>
"""


def _in_a_line(record: logging.LogRecord, what: str) -> None:
    if record.exc_info and (error := record.exc_info[1]) is not None:
        said = f"{type(error).__name__}: {error}".strip().split("\n")[0][:200]
        record.msg, record.args = f"{what}: %s", (said,)
        record.exc_info = record.exc_text = None


def _unusable_in_a_line(record: logging.LogRecord) -> bool:
    """Says in a line that a page sent a message that viser cannot use, which changes nothing."""
    if "WebsockMessageHandler" in record.getMessage():
        _in_a_line(record, "a message of a page is ignored")
    return True


def _without_traceback(record: logging.LogRecord) -> bool:
    """Says in a line what a client sent that cannot be read: it has lost its connection, and nothing
    else has happened.
    """
    _in_a_line(record, "a connection to the page was closed")
    return True


def _never_share(*_: Any, **__: Any) -> None:
    return None


def _check_free(host: str, port: int) -> None:
    """viser takes the next port when one is taken, where the page is not looked for."""
    if not 0 <= port <= 65535:
        raise ViewUnavailable(f"port = {port}: give one from 1 to 65535, or 0 for any free one")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise ViewUnavailable(
                f"{host}:{port} cannot be served ({error.strerror}): give another host or port, or"
                " port 0"
            ) from error
