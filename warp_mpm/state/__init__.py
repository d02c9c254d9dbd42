"""What a simulation holds on the device, how it is made from a scene, and what is read from it."""
