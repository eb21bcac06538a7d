"""Firefox as a test drives it: the part of the interface of Playwright that a walk needs, over WebDriver BiDi.

Playwright drives only a Firefox of its own. That of a distribution is driven by the protocol that it has itself.
"""

import asyncio
import contextlib
import json
import re
import subprocess
import tempfile
import threading
import time

#: Keys by the names that Playwright has for them.
KEYS = {
    "End": "\ue010",
    "ArrowLeft": "\ue012",
    "ArrowRight": "\ue014",
    "Delete": "\ue017",
    "Enter": "\ue007",
    "Control": "\ue009",
}


class Connection:
    """A session with a browser: commands and their results, and what the console said."""

    def __init__(self, port):
        self._loop = asyncio.new_event_loop()
        # of its own, because Playwright's runs in the thread of the tests
        threading.Thread(target=self._loop.run_forever, daemon=True).start()
        self._socket = self._result(self._opened(port))
        self._number, self.said = 0, []
        self.ask("session.new", capabilities={})
        self.ask("session.subscribe", events=["log.entryAdded"])

    def close(self):
        self._result(self._closed())
        self._loop.call_soon_threadsafe(self._loop.stop)

    async def _closed(self):
        self._socket.close()
        while await self._socket.read_message() is not None:
            pass

    def _result(self, coroutine):
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(300.0)

    async def _opened(self, port):
        # which notebooks bring along
        from tornado.websocket import websocket_connect

        return await websocket_connect(f"ws://127.0.0.1:{port}/session")

    async def _sent(self, text):
        await self._socket.write_message(text)

    async def _read(self):
        return await self._socket.read_message()

    def ask(self, method, **parameters):
        self._number += 1
        command = {"id": self._number, "method": method, "params": parameters}
        self._result(self._sent(json.dumps(command)))
        while True:
            text = self._result(self._read())
            assert text is not None, "Firefox has ended"
            message = json.loads(text)
            if message.get("id") == self._number:
                assert message["type"] == "success", message
                return message["result"]
            if message.get("method") == "log.entryAdded":
                self.said.append(message["params"]["text"])


class Page:
    """A page with the methods of Playwright's that a walk needs; its own keyboard."""

    def __init__(self, connection):
        self._ask, self.said = connection.ask, connection.said
        (tree,) = self._ask("browsingContext.getTree")["contexts"]
        self._context, self.keyboard = tree["context"], self

    def goto(self, address):
        self._ask(
            "browsingContext.navigate",
            context=self._context,
            url=address,
            wait="complete",
        )

    def reload(self):
        self._ask("browsingContext.reload", context=self._context, wait="complete")

    def evaluate(self, expression, argument=None):
        """Return the value of an expression, or of a function of an argument."""
        code = f"""(async () => {{
            const found = ({expression});
            const value = typeof found === "function" ? await found({json.dumps(argument)}) : await found;
            return JSON.stringify(value) ?? "null";
        }})()"""
        result = self._ask(
            "script.evaluate",
            expression=code,
            target={"context": self._context},
            awaitPromise=True,
        )
        assert result["type"] == "success", result["exceptionDetails"]["text"]
        return json.loads(result["result"]["value"])

    def wait_for_timeout(self, milliseconds):
        time.sleep(1e-3 * milliseconds)

    def locator(self, selector):
        return Locator(self, f"document.querySelectorAll({json.dumps(selector)})")

    def press(self, keys):
        codes = [KEYS.get(key, key) for key in keys.split("+")]
        self._act(
            [("keyDown", code) for code in codes]
            + [("keyUp", code) for code in reversed(codes)]
        )

    def type(self, text):
        self._act([(kind, sign) for sign in text for kind in ("keyDown", "keyUp")])

    def _act(self, actions):
        keys = [{"type": kind, "value": code} for kind, code in actions]
        source = {"type": "key", "id": "keyboard", "actions": keys}
        self._ask("input.performActions", context=self._context, actions=[source])


class Locator:
    """The first element of a list, by an expression."""

    def __init__(self, page, items, place=0):
        self._page, self._items, self._place = page, items, place

    def evaluate(self, function, argument=None):
        item = f"{self._items}[{self._place}]"
        code = f"(argument) => ({function})({item}, argument)"
        return self._page.evaluate(code, argument)

    def nth(self, place):
        return Locator(self._page, self._items, place)

    def count(self):
        return self._page.evaluate(f"{self._items}.length")

    def text_content(self):
        return self.evaluate("(item) => item.textContent")

    def is_visible(self):
        return self.evaluate("(item) => Boolean(item?.getClientRects().length)")

    def click(self):
        self.evaluate("(item) => item.click()")

    def focus(self):
        self.evaluate("(item) => item.focus()")

    def check(self):
        self.evaluate("(item) => item.checked || item.click()")

    def fill(self, text):
        self.focus()
        self._page.press("Control+a")
        self._page.press("Delete")
        self._page.type(text)

    def press(self, keys):
        self.focus()
        self._page.press(keys)


@contextlib.contextmanager
def firefox(program):
    """A page of a Firefox without a window and with a profile of its own."""
    with tempfile.TemporaryDirectory() as profile:
        options = ["--headless", "--remote-debugging-port=0", "--profile", profile]
        with subprocess.Popen(
            [program, *options], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        ) as process:
            try:
                port = None
                for line in process.stderr:
                    if found := re.search(rb"BiDi listening on ws://\S+:(\d+)", line):
                        port = int(found[1])
                        break
                assert port, "Firefox does not listen"
                connection = Connection(port)
                try:
                    yield Page(connection)
                finally:
                    connection.close()
            finally:
                process.kill()
