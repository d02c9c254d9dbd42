"""What accuracy costs in time: measured over the settings of a scene, and bought by the percent or by the second."""
