"""Materials of our own: the anisotropic Phong model of Ashikhmin and Shirley."""
