// Every check of what a caller gives, before anything is done with it: each throws
// std::invalid_argument, which names the table and the row.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "dqslam/costs/whitening.h"
#include "dqslam/problem/graph.h"

namespace dqslam {

[[noreturn]] void FailAt(const std::string& table, Eigen::Index row, const std::string& what);

/// The shape, and that all numbers are finite.
void CheckTable(const std::string& table,
                const RowMatrix& values,
                Eigen::Index rows,
                Eigen::Index columns);

/// As many ids as rows, each from `least` on and below `count`.
void CheckIds(const std::string& table,
              const IndexVector& ids,
              Eigen::Index rows,
              Eigen::Index count,
              int least = 0);

void CheckDistinct(const std::string& table, const IndexVector& ids);

/// That of a table of objects each occurs among the ids; its first row has the id `first`.
void CheckShown(const std::string& table, Eigen::Index rows, const IndexVector& ids, int first = 0);

void CheckUnitQuaternions(const std::string& table, PoseModel model, const RowMatrix& poses);

/// Undistorted boxes, their covariances and the flags of their edges.
void CheckBoxes(const RowMatrix& box,
                const RowMatrix& covariance,
                const BoolTable& truncated,
                Eigen::Index rows);

/// Measurements of a known kind, one a row, of objects below `num_objects`.
void CheckMeasurements(const MeasurementTable& table, Eigen::Index rows, Eigen::Index num_objects);

void CheckSizePriors(const Eigen::VectorXd& log_mean,
                     const Eigen::VectorXd& log_sigma,
                     Eigen::Index rows);

void CheckScenePriors(const ScenePriors& priors);

/// Finite poses and landmarks of the right shapes; `name` is the state's.
void CheckState(const std::string& name, const Graph& graph, const State& state);

/// The shape (rows, kSize^2), and that each row is a covariance.
template <int kSize>
void CheckCovariances(const std::string& table, const RowMatrix& covariances, Eigen::Index rows) {
  CheckTable(table, covariances, rows, kSize * kSize);
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (row > 0 && covariances.row(row) == covariances.row(row - 1)) continue;
    SqrtInformationOfRow<kSize>(table, covariances, row);
  }
}

}  // namespace dqslam
