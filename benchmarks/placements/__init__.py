"""What rules of placement give: on simulated tables, and on real tables and a road."""
