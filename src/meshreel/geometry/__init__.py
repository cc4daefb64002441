"""What the connectivity and the positions of one mesh say: Laplacians, components, anchors."""
