"""The method `reel`: mode fields, predicted over the mesh by weights learned from earlier modes."""
