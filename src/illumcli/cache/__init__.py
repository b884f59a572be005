"""What is kept between runs, and what names it."""
