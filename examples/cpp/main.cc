// Estimates the path of a robot and an object that it drives around, with covariance.
#include <dqslam/dqslam.h>

#include <iostream>

#include "circle.h"

int main() {
  const dqslam::Graph graph = MakeCircle();
  const dqslam::SolveOptions options;
  const dqslam::Solution solution = dqslam::Solve(graph, options);
  const dqslam::State state = {solution.poses, solution.landmarks};
  const dqslam::RowMatrix covariance = dqslam::ComputeCovariance(graph, options, state).objects;

  std::cout << "center, m:\n"
            << solution.landmarks.leftCols(3) << "\nits covariance, m^2:\n"
            << covariance.reshaped<Eigen::RowMajor>(9, 9).topLeftCorner<3, 3>() << '\n';
}
