"""What a scene costs: measured, predicted, and set against the barest step that this machine can do."""
