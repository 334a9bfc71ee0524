"""Boards on paper: true-scale PDF pages, objects made for a paper size, and how to join them."""
