"""The S3 store, served by moto on this machine."""

import gc
import pickle
import warnings

import fsspec
import numpy as np
import pytest

import meshreel
from meshreel.formats.options import Reading
from meshreel.operations.registering import open_part
from samples.meshes import waving_grid
from samples.stores import put

pytestmark = [
    pytest.mark.slow,
    # Warnings of s3fs, aiobotocore and moto, some during garbage collection.
    pytest.mark.filterwarnings("ignore"),
]


@pytest.fixture(scope="module")
def bucket():
    """Address of an empty bucket, configured by environment variables."""
    pytest.importorskip("s3fs", reason="the extra [s3] is not installed")
    server_of = pytest.importorskip("moto.server", reason="moto is not installed")
    server = server_of.ThreadedMotoServer(port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as settings:
        settings.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
        settings.setenv("AWS_ACCESS_KEY_ID", "testing")
        settings.setenv("AWS_SECRET_ACCESS_KEY", "testing")
        settings.setenv("AWS_DEFAULT_REGION", "us-east-1")
        settings.setenv("AWS_EC2_METADATA_DISABLED", "true")
        for name in ("AWS_PROFILE", "AWS_CONFIG_FILE", "AWS_SHARED_CREDENTIALS_FILE"):
            settings.setenv(name, "") if name != "AWS_PROFILE" else settings.delenv(name, False)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            store = fsspec.filesystem("s3")
            store.mkdir("walks")
            yield "s3://walks"
            type(store).clear_instance_cache()
            gc.collect()
    server.stop()


def test_sequence_round_trips_through_s3(bucket):
    walk = waving_grid(40)
    assert put(walk, f"{bucket}/walk.npz") == [f"{bucket}/walk.npz"]
    data = meshreel.encode(f"{bucket}/walk.npz", quality=60, block_frames=8)
    assert data == meshreel.encode(walk, quality=60, block_frames=8)
    with fsspec.open(f"{bucket}/walk.reel", "wb") as file:
        file.write(data)
    decoded = meshreel.decode(data)
    with meshreel.open(f"{bucket}/walk.reel") as reel:
        assert np.array_equal(reel[25].vertices, decoded.vertices[25])
    assert meshreel.info(f"{bucket}/walk.reel") == meshreel.info(data)
    assert np.array_equal(meshreel.decode(f"{bucket}/walk.reel").vertices, decoded.vertices)


def test_frames_round_trip_through_s3_in_order(bucket):
    walk = waving_grid(11)
    written = put(walk, f"{bucket}/frames/f_%d.ply")
    assert written[10] == f"{bucket}/frames/f_10.ply"
    for source in (f"{bucket}/frames", f"{bucket}/frames/", f"{bucket}/frames/f_*.ply", written):
        assert np.array_equal(meshreel.load(source).vertices, walk.vertices)


def test_workers_open_frames_of_a_bucket(bucket):
    walk = waving_grid(11)
    put(walk, f"{bucket}/take/f_%d.ply")
    reopen = pickle.loads(pickle.dumps(open_part(f"{bucket}/take", Reading())(range(4, 11))))
    with reopen() as part:
        assert np.array_equal([frame.vertices for frame in part], walk.vertices[4:])


def test_missing_objects_and_buckets_are_named(bucket):
    for address in (f"{bucket}/none.reel", "s3://no-such-bucket/walk.reel"):
        with pytest.raises(meshreel.StoreError, match=f"there is no {address}"):
            meshreel.open(address)


def test_missing_credentials_are_named(bucket, monkeypatch):
    monkeypatch.delenv("AWS_ACCESS_KEY_ID")
    monkeypatch.delenv("AWS_SECRET_ACCESS_KEY")
    type(fsspec.filesystem("s3")).clear_instance_cache()
    with pytest.raises(meshreel.StoreError, match=r"credentials.*AWS_ACCESS_KEY_ID"):
        meshreel.open(f"{bucket}/walk.reel")
    type(fsspec.filesystem("s3")).clear_instance_cache()


def test_unreachable_store_is_named(bucket, monkeypatch):
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
    type(fsspec.filesystem("s3")).clear_instance_cache()
    with pytest.raises(meshreel.StoreError, match="cannot be reached"):
        meshreel.open(f"{bucket}/walk.reel")
    type(fsspec.filesystem("s3")).clear_instance_cache()
