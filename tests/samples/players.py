"""A page that stands for the built one, and players of small streams."""

from contextlib import contextmanager
from io import BytesIO

from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.viewer.api import Api
from meshreel.viewer.comparison import Comparison
from meshreel.viewer.original import Original

PAGE = (
    "<!doctype html><html><head><!--meshreel-data--><title>p</title></head>"
    '<body><script type="module">1 < 2 && "<\\/script>"</script></body></html>'
)


@contextmanager
def opened_api(sequence, original=None, data=None, **options):
    """What a player of a sequence is told; its original may be another one."""
    made = encode(sequence, **options.pop("encoding", {})) if data is None else data
    with ReelFile(BytesIO(made)) as reel:
        comparison = Comparison(reel, Original(original, reel)) if original else None
        api = Api(reel, "file", lambda info: {"size": f"{info.n_frames} kB"}, comparison, **options)
        yield api
        if api.measuring:
            api.measuring.close()
