"""VTK XML files with the extension of legacy files."""

import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from meshreel.formats.save import save
from samples.meshes import waving_grid


@pytest.mark.parametrize("extension", [".vtp", ".vtu"])
def test_error_for_xml_named_vtk_gives_the_right_extension(tmp_path, extension):
    save(waving_grid(1), tmp_path / f"a_%d{extension}")
    path = (tmp_path / f"a_0{extension}").rename(tmp_path / "a.vtk")
    message = rf"a\.vtk: is a VTK XML file of \w+, not a legacy VTK file; rename it to {extension}"
    with pytest.raises(FormatError, match=message):
        load(path)
    load(path.rename(tmp_path / f"a{extension}"))


@pytest.mark.parametrize(
    ("kind", "remedy"),
    [
        ("Collection", "rename it to .pvd"),
        ("ImageData", ".vti files are not supported; convert it to .vtp or .vtu"),
        ("Table", "convert it to .vtp or .vtu"),
    ],
)
def test_error_for_other_xml_named_vtk_gives_a_remedy(tmp_path, kind, remedy):
    head = f'<?xml version="1.0"?>\n<!-- ours -->\n<VTKFile version="1.0" type="{kind}">\n'
    (tmp_path / "a.vtk").write_text(head)
    with pytest.raises(FormatError) as caught:
        load(tmp_path / "a.vtk")
    assert str(caught.value).endswith(
        f"is a VTK XML file of {kind}, not a legacy VTK file; {remedy}"
    )


def test_file_without_the_vtk_signature_is_rejected(tmp_path):
    (tmp_path / "a.vtk").write_bytes(b"<svg/>")
    with pytest.raises(FormatError, match="does not begin with '# vtk DataFile Version'"):
        load(tmp_path / "a.vtk")
