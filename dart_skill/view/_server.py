"""The web server of the view: viser, an optional package, bound to this machine and closed to
pages of other origins.
"""

from __future__ import annotations

import contextlib
import hmac
import http
import importlib
import io
import ipaddress
import logging
import secrets
import socket
from collections.abc import Callable, Iterator, Mapping
from types import ModuleType
from typing import Any
from urllib.parse import urlsplit

from dart_skill.common.extras import remedy

POLICY_VIOLATION = 1008
"""Status with which a websocket is closed (RFC 6455, section 7.4.1)."""


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
    with contextlib.redirect_stdout(io.StringIO()), _refusing_long_paths():
        server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
    _refuse_strangers(server, token)
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


def _refuse_strangers(server: Any, token: str) -> None:
    # viser has no public way to see the request of a connection
    websockets = server._websock_server

    async def check(connection: Any) -> None:
        socket_of_client = websockets._live_connections[connection.client_id]
        if not is_own_page(socket_of_client.request.headers):
            await socket_of_client.close(
                POLICY_VIOLATION, "pages of other origins do not move this arm"
            )
        elif not has_token(socket_of_client.request.path, token):
            await socket_of_client.close(
                POLICY_VIOLATION, "open the whole address that the viewer prints"
            )

    websockets.on_client_connect(check)


@contextlib.contextmanager
def _refusing_long_paths() -> Iterator[None]:
    """Where viser opens its server: a request for what cannot be the name of a file is answered with
    404 (NOT FOUND). viser asks the system for it, and answers with 500 (INTERNAL SERVER ERROR).
    """
    module: Any = importlib.import_module("websockets.asyncio.server")
    serve = module.serve

    def serving(*args: Any, process_request: Callable, **others: Any) -> Any:
        def answer(connection: Any, request: Any) -> Any:
            try:
                return process_request(connection, request)
            except (OSError, ValueError):
                return connection.respond(http.HTTPStatus.NOT_FOUND, "NOT FOUND\n")

        return serve(*args, process_request=answer, **others)

    module.serve = serving
    try:
        yield
    finally:
        module.serve = serve


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
