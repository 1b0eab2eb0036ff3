"""Least-squares adjustment of passes: spline corrections, robust weights, choice of stiffness."""
