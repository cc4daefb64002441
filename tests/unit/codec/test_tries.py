"""Progress of a search for the step that meets a target."""

import pytest

import meshreel
from samples.meshes import waving_grid


def heard(**target):
    results = []
    meshreel.encode(
        waving_grid(), **target, progress=lambda stage, share: results.append((stage, share))
    )
    return results


@pytest.mark.parametrize("target", [{"kg": 0.5}, {"size": 1500}, {"max_error": 0.05}])
@pytest.mark.parametrize("block_frames", [None, 4])
def test_search_never_reports_completion_of_a_trial(target, block_frames):
    result = heard(**target, block_frames=block_frames)
    tries = {stage for stage, _ in result if stage.startswith("encoding, try")}
    assert len(tries) > 1
    assert all(share < 1 for stage, share in result if stage in tries)
    assert all((stage, 0.0) in result for stage in tries)


def test_single_trial_reports_completion():
    assert heard(quality=60)[-1] == ("encoding", 1.0)
