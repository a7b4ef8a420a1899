"""Colors of figures and pages that color-blind readers can distinguish (Okabe and Ito)."""

BLUE, ORANGE, GREEN, VERMILLION = "#0072B2", "#E69F00", "#009E73", "#D55E00"
SKY, PURPLE, YELLOW, GRAY = "#56B4E9", "#CC79A7", "#F0E442", "#808080"
# The paths have the paper's colors.
ODOMETRY, TRUTH, ESTIMATE = BLUE, GREEN, VERMILLION
