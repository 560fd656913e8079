"""The loop from a design to a better one: what is asked, searched, judged, recorded and found."""
