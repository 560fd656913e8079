"""What a report says in the trade's own terms: tolerances, and the limits of zones."""
