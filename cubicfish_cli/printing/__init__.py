"""Boards on paper: true-scale PDF pages, targets made for a paper size, and how to join them."""
