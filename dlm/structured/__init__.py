"""`model: structured`: perceived geometry, contact classes proposed by a network, and convex checks that choose among them."""
