"""Text about surfaces."""

import numpy as np

from meshreel.model.cells import Cells
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.surface_description import describe_surface


def test_cells_are_counted_by_type_and_attributes_name_their_domain():
    types = np.array([12, 10, 25, 12], np.uint8)
    cells = Cells(types, np.zeros(8 + 4 + 20 + 8, np.int32))
    density = Attribute("density", Kind.OTHER, Domain.CELL, np.ones((4, 1)))
    texts = describe_surface(Surface(attributes=(density,), cells=cells))
    assert texts["cells"] == ("1 tetrahedron", "2 hexahedra", "1 hexahedron of 20 nodes")
    assert texts["attributes"] == ("other 'density' of cells",)


def test_surface_without_cells_has_no_text_about_them():
    assert describe_surface(Surface())["cells"] == ()
