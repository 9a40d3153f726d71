"""What moves the walls: the oedometer, stages of a test, walls held at a force, speed."""
