"""Our codec: mode fields, predicted over the mesh by weights learned from earlier ones."""
