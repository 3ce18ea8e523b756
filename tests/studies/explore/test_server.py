"""The explorer's door: host, origin, token, paths, methods, and messages that no page of ours sends."""

import asyncio
import json
import socket
import time
from collections.abc import Iterator
from http.client import HTTPConnection
from types import SimpleNamespace
from typing import Any

import pytest
from explore_sample import small_transport

pytest.importorskip("uvicorn", reason="needs rodcone[explore]")
pytest.importorskip("websockets", reason="needs rodcone[explore]")

from explore_browser import served as explorer
from refusal import refusal

from rodcone.errors import MOST_TOLD
from studies.explore import server
from studies.explore.controls import Controls, controls_from, to_json
from studies.explore.messages import read_message
from studies.explore.server import BURST_S, MOST_A_SECOND, MOST_CHARACTERS_A_SECOND, listen
from studies.explore.source import of_transport


@pytest.fixture(scope="module")
def served() -> Iterator[tuple[int, str]]:
    """Port and token of an explorer."""
    with explorer(of_transport(small_transport())) as address:
        _, _, host, token, *_ = address.split("/")
        yield int(host.rpartition(":")[2]), token


def asked(port: int, path: str, method: str = "GET", **headers: str) -> tuple[int, Any]:
    connection = HTTPConnection("127.0.0.1", port, timeout=300)
    connection.request(method, path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer.status, answer.headers


def test_the_page_and_its_files_are_served_with_a_policy(served):
    port, token = served
    for name in ("", "explore.js", "explore_page.js", "explore.css"):
        status, headers = asked(port, f"/{token}/{name}")
        assert status == 200, name
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "http" not in policy
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Server"] is None  # which program answers, and of which version, is nobody's concern
    assert asked(port, f"/{token}/", Host=f"localhost:{port}")[0] == 200


def test_the_server_listens_on_this_machine_alone(served):
    with listen(0) as listener:
        assert listener.getsockname()[0] == "127.0.0.1"
    own = {each[4][0] for each in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}
    for address in own:
        if not address.startswith("127."):
            with pytest.raises(OSError), socket.create_connection((address, served[0]), timeout=2):  # noqa: PT011
                pass


def test_other_hosts_names_are_refused(served):
    port, token = served
    for host in ("evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", ""):
        assert asked(port, f"/{token}/", Host=host.format(port=port))[0] in (400, 403)


def test_other_origins_tokens_paths_and_methods_are_refused(served):
    port, token = served
    assert asked(port, f"/{token}/", Origin="http://evil.example")[0] == 403
    assert asked(port, f"/{token}/", Origin="null")[0] == 403
    beside = (f"/{token[:-1]}/", f"/{token}x/", f"/{token}", f"/{token}/../{token}/x", "/", "/explore.js", "/%00/")
    under = ("report.html.j2", "..%2f..%2fpage.py", "explore.js/", "live/", "%2e%2e/")
    for path in (*beside, *(f"/{token}/{name}" for name in under)):
        assert asked(port, path)[0] == 403, path
    for method in ("POST", "PUT", "DELETE", "OPTIONS"):
        assert asked(port, f"/{token}/", method)[0] == 403, method


def connected(port: int, path: str, **options: Any) -> Any:
    from websockets.sync.client import connect

    return connect(f"ws://127.0.0.1:{port}{path}", open_timeout=20, compression=None, **options)


def test_a_socket_of_another_page_is_refused(served):
    from websockets.exceptions import InvalidStatus

    port, token = served
    own = {"origin": f"http://127.0.0.1:{port}"}
    for path, options in (
        (f"/{token}/live", {}),
        (f"/{token}/live", {"origin": "http://evil.example"}),
        (f"/{token}/live", {"origin": "null"}),
        (f"/{token}/live", {"origin": f"https://127.0.0.1:{port}"}),
        ("/wrong/live", own),
        (f"/{token}/", own),
    ):
        with pytest.raises(InvalidStatus) as caught, connected(port, path, **options):
            pass
        assert caught.value.response.status_code == 403, (path, options)


def received(connection: Any) -> dict[str, Any]:
    data = connection.recv(timeout=300)
    length = int.from_bytes(data[:4], "little")
    header: dict[str, Any] = json.loads(data[4 : 4 + length])
    assert sum(header["lengths"]) == len(data) - 4 - length
    return header


HOSTILE = [
    "", "{", "[]", "null", "7", '"show"', "{}", '{"kind": "show"}', '{"kind": "eval", "number": 1}', "[" * 100_000,
    '{"kind": ["show"], "number": 1}', '{"kind": "hello", "number": -1}', '{"kind": "hello", "number": 1e400}',
    '{"kind": "hello", "number": 1, "page": 3}', '{"kind": "hello", "number": 1, "page": "' + "x" * 99 + '"}',
    '{"kind": "hello", "number": NaN}', '{"kind": "hello", "number": 1, "more": 2}', "x" * 300_000,
    '{"kind": "show", "number": 1, "cameras": [], "views": [[0, "picture"]]}',
    '{"kind": "show", "number": 1, "cameras": [{}], "views": [[1, "picture"]]}',
    '{"kind": "show", "number": 1, "cameras": [{}], "views": [[0, "__class__"]]}',
    '{"kind": "show", "number": 1, "cameras": [{}], "views": [[0, ["picture"]]]}',
    '{"kind": "show", "number": 1, "cameras": [{"sensor": "../secret.toml"}], "views": [[0, "raw"]]}',
    '{"kind": "show", "number": 1, "cameras": [{"reference_light": "SECRET"}], "views": [[0, "raw"]]}',
    '{"kind": "show", "number": 1, "cameras": [{"lamps": {"sun": {"spectrum": "SECRET"}}}], "views": [[0, "raw"]]}',
    '{"kind": "show", "number": 1, "cameras": [{"frames": 100000}], "views": [[0, "raw"]]}',
    '{"kind": "show", "number": 1, "cameras": [{"settings": {"neighbourhood": 1e9}}], "views": [[0, "raw"]]}',
    '{"kind": "pixel", "number": 1, "cameras": [{}], "row": "0", "column": 0}',
    '{"kind": "pixel", "number": 1, "cameras": [{}], "row": 1e9, "column": 0}',
    '{"kind": "pixel", "number": 1, "cameras": [{}], "row": 1, "column": "2); import os"}',
    '{"kind": "scene", "number": 1, "name": "SECRET"}', '{"kind": "scene", "number": 1, "name": ["still_life"]}',
    *(f'{{"kind": "sensor", "number": 1, "files": {files}}}' for files in (
        "[]", "{}", '{"../chip.toml": ""}', '{"/chip.toml": ""}', '{"chip.py": ""}', '{"LONG.toml": ""}',
        '{"a.toml": 3}', '{"a.toml": "", "b.toml": ""}', '{"a.csv": "1,2"}', '{"a.toml": "= 3"}',
        r'{"a.toml": "[responses]\ncsv = \"SECRET\""}', r'{"a.toml": "[responses]\nir_cut = \"../secret.CSV\""}',
        r'{"a.toml": "[responses]\nir_cut = [\"SECRET\"]"}', '{"a.toml": "responses = 3"}',
    )),
    '{"kind": "study", "number": 1, "cameras": [{}]}', '{"kind": "LONG", "number": 1}',
    '{"kind": "hello", "number": 1, "LONG": 2}', '{"kind": "show", "number": 1, "cameras": "LONG", "views": []}',
    '{"kind": "show", "number": 1, "cameras": [{"sensor": "LONG"}], "views": [[0, "raw"]]}',
    '{"kind": "show", "number": 1, "cameras": [{"lamps": {"LONG": {}}}], "views": [[0, "raw"]]}',
    '{"kind": "show", "number": 1, "cameras": [{"lens": "LONG"}], "views": [[0, "raw"]]}',
    '{"kind": "show", "number": 1, "cameras": [{}], "views": [[0, "LONG"]]}',
]  # fmt: skip


def test_hostile_messages_get_one_line_and_the_next_is_answered(served, tmp_path):
    port, token = served
    secret = tmp_path / "secret.CSV"
    secret.write_text("password,hunter2\n1,2\n", "utf-8")
    with connected(port, f"/{token}/live", origin=f"http://127.0.0.1:{port}", max_size=None) as connection:
        for text in HOSTILE:
            connection.send(text.replace("SECRET", secret.as_posix()).replace("LONG", "y" * 150_000))
            header = received(connection)
            assert header["kind"] == "error", text[:80]
            assert "\n" not in header["message"]
            assert len(header["message"]) <= MOST_TOLD
            assert "program failed" not in header["message"], header
            assert "password" not in header["message"], header
        connection.send(b"\x00\x01")
        assert received(connection)["kind"] == "error"
        connection.send('{"kind": "show", "number": 5, "cameras": [{}], "views": [[0, "picture"]]}')
        header = received(connection)
        assert (header["kind"], header["number"], header["size"]) == ("show", 5, [40, 48])


@pytest.mark.thorough
@pytest.mark.parametrize(("text", "most"), [("{", MOST_A_SECOND), ("{" * 150_000, MOST_CHARACTERS_A_SECOND / 150_000)])
def test_a_page_that_floods_is_read_at_its_pace(served, text, most):
    port, token = served
    count = round((BURST_S + 1) * most)
    with connected(port, f"/{token}/live", origin=f"http://127.0.0.1:{port}", max_size=None) as connection:
        start = time.monotonic()
        for _ in range(count):
            connection.send(text)
        for _ in range(count):
            received(connection)
        assert time.monotonic() - start > 0.9  # 1 s by the loop's clock, which began with the connection


def test_a_message_waits_for_what_came_before_it(served, monkeypatch):
    """By a clock that stands still: each message costs its own time and that of its characters, after a burst free."""
    port, token = served
    waited, texts = [], ["{" * 150_000] * 12

    async def sleep(seconds):
        waited.append(seconds)

    class Loop:
        def __getattr__(self, name):
            return getattr(asyncio.get_running_loop(), name)

        def time(self):
            return 100.0

    still = SimpleNamespace(**vars(asyncio) | {"sleep": sleep, "get_running_loop": Loop})
    each_s = 1 / MOST_A_SECOND + 150_000 / MOST_CHARACTERS_A_SECOND
    monkeypatch.setattr(server, "asyncio", still)
    monkeypatch.setattr(server, "BURST_S", 4.5 * each_s)
    with connected(port, f"/{token}/live", origin=f"http://127.0.0.1:{port}", max_size=None) as connection:
        for text in texts:
            connection.send(text)
            received(connection)
    assert waited == pytest.approx([max(0.0, (n - 4.5) * each_s) for n in range(1, 13)])


NOT_ALLOWED: list[Any] = [
        [], None, {"level_cd_m2": "25"}, {"level_cd_m2": True}, {"level_cd_m2": -1}, {"seed": 0.5}, {"seed": True},
        {"seed": -1}, {"bits": 99.5}, {"lamps": []}, {"lamps": {"sun": 3}}, {"lamps": {"sun": {"power": "x"}}},
        {"lamps": {"sun": {"table": [[1]]}}}, {"lamps": {"sun": {"table": [[1, 2]] * 3000}}}, {"lens": {"nope": 1}},
        {"pixel": {"pitch_um": 1}}, {"processor": "no"}, {"processor": 3}, {"mosaic": "cmyw"}, {"exposure": "auto:Z"},
        {"processor": "interleaved", "settings": {"sigma_d": 0}},
        {"processor": "interleaved", "settings": {"patch": 2}}, {"settings": {"patch": 3}},
        {"unknown": 1}, {"exposure_s": 0},
        {"processor": "bayer", "mosaic": "bayer", "settings": {"patch": 3}}, {"shot_noise": 1}, {"shot_noise": "off"},
]  # fmt: skip


def test_controls_that_are_not_allowed_are_refused():
    for content in NOT_ALLOWED:
        refusal(controls_from, content, match=r"\A.*\Z")


def test_controls_come_back_from_json():
    import random

    from explore_sample import random_controls

    rng = random.Random(5)
    for _ in range(30):
        controls = random_controls(rng)
        assert controls_from(json.loads(json.dumps(to_json(controls)))) == controls
    assert controls_from({}) == Controls()
    assert read_message('{"kind": "hello", "number": 3}')["number"] == 3
