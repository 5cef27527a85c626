"""Parametric parts with known truth: walls, blades, struts and the connections between them."""
