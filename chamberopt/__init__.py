"""chamberopt: designs ultrasonic shot peening chambers."""
