"""What several problems share: placement of particles, waves from the ends, and figures."""
