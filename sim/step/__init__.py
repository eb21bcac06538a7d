"""Order of the parts in a clock step: two steppers, of which a scene has one."""
