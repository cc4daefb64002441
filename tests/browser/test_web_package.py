"""The package `meshreel` in a real browser decodes the same bits as Python."""

import hashlib
import json

import pytest

import meshreel
from conformance.make import FOLDER
from meshreel.codec.bitstream.layout import Section
from samples.firefox import message_of
from samples.streams import Stream, parts_of, raw_stream
from samples.web_package import serving

POLICY = "Content-Security-Policy"
METHODS = ("reel", "lossless", "grid")
WITHOUT_WORKERS = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'"

HASHES = """async (names) => {
  const { ReelFile } = await import("/dist/index.js");
  const hashOf = async (nFrames, read) => {
    const frames = [];
    for (let i = 0; i < nFrames; i++) frames.push(await read(i));
    const bytes = await new Blob(frames).arrayBuffer();
    const hash = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
    return Array.from(hash, (byte) => byte.toString(16).padStart(2, "0")).join("");
  };
  const found = {};
  for (const name of names) {
    const reel = await ReelFile.open(`/${name}.reel`);
    const { nFrames, tracks } = reel.info;
    found[name] = [await hashOf(nFrames, (i) => reel.frame(i)), reel.isInWorker];
    for (const { name: track } of tracks) {
      found[`${name}: ${track}`] = await hashOf(nFrames, (i) => reel.track(track).frame(i));
    }
    reel.close();
    globalThis.gc?.(); // WebAssembly memories, of which a process has 124
  }
  return found;
}"""


def stored_streams():
    """Return the streams that pages decode, by path."""
    names = sorted(path.stem for path in FOLDER.glob("*.json"))
    played = [name for name in names if description(name)["method"] in METHODS]
    assert len(played) >= 96
    return {f"/{name}.reel": (FOLDER / f"{name}.reel").read_bytes() for name in played}


def description(name):
    return json.loads((FOLDER / f"{name}.json").read_text("utf-8"))


def stored_hashes(paths, *, is_in_worker):
    """Return the hashes of positions and tracks, and whether a worker decodes the positions."""
    hashes = {}
    for name in (path[1:-5] for path in paths):
        hashes[name] = [description(name)["hash of positions"], is_in_worker]
        for track in description(name).get("tracks", ()):
            hashes[f"{name}: {track['name']}"] = track["hash of values"]
    return hashes


def hash_of(sequence):
    return hashlib.sha256(sequence.vertices.tobytes()).hexdigest()


@pytest.fixture(scope="module")
def sheet():
    """A stream of many blocks, larger than the first request."""
    flag = meshreel.simulate_flag(120, n_rows=40, n_columns=40)
    return meshreel.encode(flag, quality=100, block_frames=10)


@pytest.mark.parametrize(
    ("policy", "is_in_worker"),
    [
        ("", True),
        (WITHOUT_WORKERS, False),
        (f"{WITHOUT_WORKERS}; worker-src blob:", True),
        (f"{WITHOUT_WORKERS}; worker-src 'none'", False),
    ],
)
def test_positions_and_tracks_of_streams_match(new_page, policy, is_in_worker):
    files = dict([*stored_streams().items()][:: 9 if policy else 1])  # all of them once
    with serving(files, {POLICY: policy} if policy else None) as (url, _):
        page = new_page(url, is_shown=False)
        result = page.evaluate(HASHES, [path[1:-5] for path in files])
    assert result == stored_hashes(files, is_in_worker=is_in_worker)


@pytest.mark.parametrize(
    ("more", "loaded"),
    [
        ("connect-src *", ["index.js", "reel.wasm", "reel_full.wasm"]),
        ("connect-src 'self'", ["embedded_module.js", "index.js"]),
    ],
)
def test_decoder_of_another_origin_is_loaded_as_the_policy_allows(new_page, more, loaded):
    files = dict([*stored_streams().items()][::9])
    names = [path[1:-5] for path in files]
    with serving({}, {"Access-Control-Allow-Origin": "*"}) as (host, _):
        policy = f"{WITHOUT_WORKERS} {host}; worker-src blob:; {more}"
        with serving(files, {POLICY: policy}) as (url, _):
            page = new_page(url, is_shown=False)
            seen = []
            page.on("requestfinished", lambda request: seen.append(request.url))
            result = page.evaluate(HASHES.replace('"/dist', f'"{host}/dist'), names)
    assert result == stored_hashes(files, is_in_worker=True)
    assert sorted(path[len(f"{host}/dist/") :] for path in seen if path.startswith(host)) == loaded


def test_positions_and_tracks_match_in_firefox():
    files = stored_streams()
    script = f"""
      ({HASHES})({json.dumps([path[1:-5] for path in files])})
        .then((found) => found, (error) => ({{ error: `${{error.name}}: ${{error.message}}` }}))
        .then((found) => fetch("/", {{ method: "POST", body: JSON.stringify(found) }}));
    """
    page = f"<!doctype html><script type=module>{script}</script>".encode()
    result = message_of({**files, "/all.html": page}, "/all.html", is_headless=True)
    assert result == stored_hashes(files, is_in_worker=True)


def test_errors_have_their_types(new_page, sheet):
    damaged = bytearray(sheet)
    damaged[len(sheet) // 2] ^= 1
    files = {"/damaged.reel": bytes(damaged), "/text.reel": b"no reel at all" * 9}
    with serving(files) as (url, _):
        page = new_page(url, is_shown=False)
        result = page.evaluate(
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
    assert result["missing"] == "SourceError"
    assert result["text"] == "CorruptStreamError"
    assert sorted(set(result["names"])) == ["CorruptStreamError", "fine"]
    assert result["names"].count("CorruptStreamError") == 1


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
        result = page.evaluate(HASHES, ["sound"])
        error = page.evaluate(
            """async () => {
              const { ReelFile } = await import("/dist/index.js");
              return ReelFile.open("/damaged.reel").then(() => "none", (error) => error.name);
            }"""
        )
    assert result == {"sound": [hash_of(meshreel.decode(sheet)), True]}
    assert error in ("CorruptStreamError", "TruncatedStreamError")
