"""From a session to its equations: least squares, what it says about itself, what a person should see."""
