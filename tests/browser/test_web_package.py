"""The package `meshreel` in a real browser decodes the same bits as Python."""

import hashlib
import json
import shutil
import subprocess
from queue import Empty, Queue
from tempfile import TemporaryDirectory

import pytest

import meshreel
from conformance.make import FOLDER
from meshreel.codec.bitstream.layout import Section
from samples.streams import Stream, parts_of, raw_stream
from samples.web_package import built_package, serving

POLICY = "Content-Security-Policy"
FIREFOX_S = 120
WITHOUT_WORKERS = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'"

HASHES = """async (names) => {
  const { ReelFile } = await import("/dist/index.js");
  const found = {};
  for (const name of names) {
    const reel = await ReelFile.open(`/${name}.reel`);
    const frames = [];
    for (let i = 0; i < reel.info.nFrames; i++) frames.push(await reel.frame(i));
    const bytes = await new Blob(frames).arrayBuffer();
    const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
    const text = Array.from(hash, (one) => one.toString(16).padStart(2, "0")).join("");
    found[name] = [text, reel.isInWorker];
    reel.close();
  }
  return found;
}"""


TRACK_HASHES = """async (names) => {
  const { ReelFile } = await import("/dist/index.js");
  const found = {};
  for (const name of names) {
    const reel = await ReelFile.open(`/${name}.reel`);
    for (const { name: track } of reel.info.tracks) {
      const frames = [];
      for (let i = 0; i < reel.info.nFrames; i++) frames.push(await reel.track(track).frame(i));
      const bytes = await new Blob(frames).arrayBuffer();
      const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
      const text = Array.from(hash, (one) => one.toString(16).padStart(2, "0")).join("");
      found[`${name}: ${track}`] = text;
    }
    reel.close();
  }
  return found;
}"""


@pytest.fixture(scope="module", autouse=True)
def _package():
    built_package()


def stream_descriptions():
    """Return the descriptions of the streams that pages decode, by name."""
    descriptions = {
        path.stem: json.loads(path.read_text("utf-8")) for path in FOLDER.glob("*.json")
    }
    played = "reel", "lossless", "grid"
    return {name: one for name, one in descriptions.items() if one["method"] in played}


def streams_with_tracks():
    """Return the names of streams with tracks, and hashes of the values of each track."""
    descriptions = {
        name: one["tracks"] for name, one in stream_descriptions().items() if one.get("tracks")
    }
    hashes = {
        f"{name}: {track['name']}": track["hash of values"]
        for name, tracks in descriptions.items()
        for track in tracks
    }
    return sorted(descriptions), hashes


def hash_of(sequence):
    return hashlib.sha256(sequence.vertices.tobytes()).hexdigest()


@pytest.fixture(scope="module")
def sheet():
    """A stream of many blocks, larger than the first request."""
    return meshreel.encode(meshreel.simulate_flag(120, n_rows=40, n_columns=40), block_frames=10)


def test_positions_of_every_stream_match(new_page):
    descriptions = stream_descriptions()
    assert len(descriptions) >= 96
    files = {f"/{name}.reel": (FOLDER / f"{name}.reel").read_bytes() for name in descriptions}
    with serving(files) as (url, _):
        page = new_page(url, is_shown=False)
        found = page.evaluate(HASHES, sorted(descriptions))
    wanted = {name: [one["hash of positions"], True] for name, one in descriptions.items()}
    assert found == wanted


@pytest.mark.parametrize("policy", ["worker-src blob:", "worker-src 'none'"])
def test_track_values_of_every_stream_match(new_page, policy):
    names, wanted = streams_with_tracks()
    assert len(wanted) >= 8
    files = {f"/{name}.reel": (FOLDER / f"{name}.reel").read_bytes() for name in names}
    with serving(files, {POLICY: f"{WITHOUT_WORKERS}; {policy}"}) as (url, _):
        page = new_page(url, is_shown=False)
        assert page.evaluate(TRACK_HASHES, names) == wanted


@pytest.mark.skipif(shutil.which("firefox") is None, reason="needs Firefox")
def test_positions_and_tracks_match_in_firefox():
    descriptions = stream_descriptions()
    with_tracks, hashes = streams_with_tracks()
    files = {f"/{name}.reel": (FOLDER / f"{name}.reel").read_bytes() for name in descriptions}
    script = f"""
      const text = (error) => error.name + ": " + error.message;
      const both = async () => ({{
        ...(await ({HASHES})({json.dumps(sorted(descriptions))})),
        ...(await ({TRACK_HASHES})({json.dumps(with_tracks)})),
      }});
      both()
        .then((found) => found, (error) => ({{ error: text(error) }}))
        .then((found) => fetch("/", {{ method: "POST", body: JSON.stringify(found) }}));
    """
    files["/all.html"] = f"<!doctype html><script type=module>{script}</script>".encode()
    posted = Queue()
    # The browser may still write into its profile while that is removed.
    profiles = TemporaryDirectory(ignore_cleanup_errors=True)
    with serving(files, posted=posted) as (url, _), profiles as profile:
        command = ["firefox", "--headless", "--no-remote", "--profile", profile, f"{url}/all.html"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            found = json.loads(posted.get(timeout=FIREFOX_S))
        except Empty:
            pytest.fail(f"Firefox descriptions nothing for {FIREFOX_S} s")
        finally:
            process.terminate()
            process.wait()
    positions = {name: [one["hash of positions"], True] for name, one in descriptions.items()}
    assert found == {**positions, **hashes}


def test_a_policy_with_one_directive_is_enough(new_page, sheet):
    with serving({"/sheet.reel": sheet}, {POLICY: WITHOUT_WORKERS}) as (url, _):
        page = new_page(url, is_shown=False)
        found = page.evaluate(HASHES, ["sheet"])
    assert found == {"sheet": [hash_of(meshreel.decode(sheet)), False]}


def test_frames_are_decoded_in_a_worker_where_the_policy_allows_it(new_page, sheet):
    policy = f"{WITHOUT_WORKERS}; worker-src blob:"
    with serving({"/sheet.reel": sheet}, {POLICY: policy}) as (url, _):
        page = new_page(url, is_shown=False)
        found = page.evaluate(HASHES, ["sheet"])
    assert found == {"sheet": [hash_of(meshreel.decode(sheet)), True]}


def test_only_requested_blocks_are_read(new_page, sheet):
    with serving({"/sheet.reel": sheet}) as (url, asked):
        page = new_page(url, is_shown=False)
        page.evaluate(
            """async () => {
              const { ReelFile } = await import("/dist/index.js");
              const reel = await ReelFile.open("/sheet.reel");
              await reel.frame(reel.info.nFrames - 1);
              reel.close();
            }"""
        )
    n_read = sum(last - first + 1 for first, last in asked)
    assert len(sheet) > 3 * 65536
    assert n_read < len(sheet) / 2


def test_errors_have_their_types(new_page, sheet):
    damaged = bytearray(sheet)
    damaged[len(sheet) // 2] ^= 1
    files = {"/damaged.reel": bytes(damaged), "/text.reel": b"no reel at all" * 9}
    with serving(files) as (url, _):
        page = new_page(url, is_shown=False)
        found = page.evaluate(
            """async () => {
              const meshreel = await import("/dist/index.js");
              const nameOf = async (work) => work().then(() => "fine", (error) => error.name);
              const reel = await meshreel.ReelFile.open("/damaged.reel");
              const names = [];
              for (const { start } of reel.info.blocks) {
                names.push(await nameOf(() => reel.frame(start)));
              }
              reel.close();
              return {
                names,
                missing: await nameOf(() => meshreel.ReelFile.open("/missing.reel")),
                text: await nameOf(() => meshreel.ReelFile.open("/text.reel")),
              };
            }"""
        )
    assert found["missing"] == "SourceError"
    assert found["text"] == "CorruptStreamError"
    assert sorted(set(found["names"])) == ["CorruptStreamError", "fine"]
    assert found["names"].count("CorruptStreamError") == 1


def test_invalid_connectivity_is_reported_despite_early_decoding(new_page, sheet):
    stream = Stream(sheet)
    sections = parts_of(stream)
    place = [number for number, _ in sections].index(Section.CONNECTIVITY)
    payload = sections[place][1]
    damaged = [*sections]
    damaged[place] = (Section.CONNECTIVITY, payload[: len(payload) // 2])
    files = {
        "/sound.reel": raw_stream(stream.header, sections),
        "/damaged.reel": raw_stream(stream.header, damaged),
    }
    assert min(map(len, files.values())) > 2 * 65536
    with serving(files) as (url, _):
        page = new_page(url, is_shown=False)
        found = page.evaluate(HASHES, ["sound"])
        error = page.evaluate(
            """async () => {
              const { ReelFile } = await import("/dist/index.js");
              return ReelFile.open("/damaged.reel").then(() => "none", (error) => error.name);
            }"""
        )
    assert found == {"sound": [hash_of(meshreel.decode(sheet)), True]}
    assert error in ("CorruptStreamError", "TruncatedStreamError")
