// Block matrices for tests, and their dense counterparts.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <utility>
#include <vector>

#include "dqslam/linear/block_matrix.h"
#include "random.h"

namespace dqslam {

using Pairs = std::vector<std::pair<int, int>>;

struct Pattern {
  std::vector<int> sizes;
  Pairs pairs;
};

/// Poses in a chain, blocks 0 to poses - 1; then objects, each seen from a stretch of poses and
/// from a second one later; then switches, each on the tie of two poses that closes a loop.
inline Pattern ChainWithObjects(int poses, int pose_size, int objects, int loops, Random& random) {
  Pattern pattern;
  pattern.sizes.assign(poses, pose_size);
  for (int k = 1; k < poses; ++k) pattern.pairs.emplace_back(k - 1, k);
  for (int object = 0; object < objects; ++object) {
    const int block = static_cast<int>(pattern.sizes.size());
    pattern.sizes.push_back(9);
    for (int visit = 0; visit < 2; ++visit) {
      const int first = static_cast<int>(random.Uniform(0, poses));
      for (int k = first; k < std::min(poses, first + poses / 5 + 1); ++k) {
        pattern.pairs.emplace_back(block, k);
      }
    }
  }
  for (int loop = 0; loop < loops; ++loop) {
    const int first = static_cast<int>(random.Uniform(0, poses / 2));
    const int last = static_cast<int>(random.Uniform(poses / 2, poses));
    const int block = static_cast<int>(pattern.sizes.size());
    pattern.sizes.push_back(1);
    pattern.pairs.insert(pattern.pairs.end(), {{last, first}, {first, block}, {block, last}});
  }
  return pattern;
}

/// A long drive: every 50 poses an object, seen from 100.
inline Pattern Drive(int poses) {
  Pattern pattern{std::vector<int>(poses, 3), {}};
  for (int k = 1; k < poses; ++k) pattern.pairs.emplace_back(k - 1, k);
  for (int first = 0; first + 100 <= poses; first += 50) {
    const int block = static_cast<int>(pattern.sizes.size());
    pattern.sizes.push_back(9);
    for (int k = 0; k < 100; ++k) pattern.pairs.emplace_back(first + k, block);
  }
  return pattern;
}

/// Long drives that meet at one object, which each sees from its first pose.
inline Pattern MeetingDrives(int drives, int poses) {
  Pattern pattern{{9}, {}};
  for (int drive = 0; drive < drives; ++drive) {
    const Pattern one = Drive(poses);
    const int first = static_cast<int>(pattern.sizes.size());
    pattern.sizes.insert(pattern.sizes.end(), one.sizes.begin(), one.sizes.end());
    for (const auto& [i, j] : one.pairs) pattern.pairs.emplace_back(first + i, first + j);
    pattern.pairs.emplace_back(0, first);
  }
  return pattern;
}

/// Any blocks of the sizes that occur, any pairs; parts may be disconnected.
inline Pattern RandomPattern(int blocks, int pairs, Random& random) {
  Pattern pattern;
  const int kinds[] = {1, 3, 6, 9};
  for (int b = 0; b < blocks; ++b) {
    pattern.sizes.push_back(kinds[static_cast<int>(random.Uniform(0, 4))]);
  }
  while (static_cast<int>(pattern.pairs.size()) < pairs) {
    const int i = static_cast<int>(random.Uniform(0, blocks));
    const int j = static_cast<int>(random.Uniform(0, blocks));
    if (i != j) pattern.pairs.emplace_back(i, j);
  }
  return pattern;
}

/// Adds J^T J of one residual per pair, of as many rows as both blocks have, and I.
inline void FillPositiveDefinite(const Pattern& pattern, Random& random, BlockMatrix& A) {
  const auto Normal = [&] { return random.Normal(); };
  const auto Add = [&](double* block, const Eigen::MatrixXd& value) {
    Eigen::Map<Eigen::MatrixXd>(block, value.rows(), value.cols()) += value;
  };
  for (int b = 0; b < A.num_blocks(); ++b) {
    Add(A.Diagonal(b), Eigen::MatrixXd::Identity(A.size(b), A.size(b)));
  }
  for (size_t k = 0; k < pattern.pairs.size(); ++k) {
    const int index = A.index_of_pair(k);
    const auto [i, j] = A.coupled(index);
    const int rows = A.size(i) + A.size(j);
    const Eigen::MatrixXd Ji = Eigen::MatrixXd::NullaryExpr(rows, A.size(i), Normal);
    const Eigen::MatrixXd Jj = Eigen::MatrixXd::NullaryExpr(rows, A.size(j), Normal);
    Add(A.Diagonal(i), Ji.transpose() * Ji);
    Add(A.Diagonal(j), Jj.transpose() * Jj);
    Add(A.OffDiagonal(index), Ji.transpose() * Jj);
  }
}

/// From the lower triangles on the diagonal and the blocks off it.
inline Eigen::MatrixXd Dense(const BlockMatrix& A) {
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(A.rows(), A.rows());
  using ConstBlock = Eigen::Map<const Eigen::MatrixXd>;
  for (int b = 0; b < A.num_blocks(); ++b) {
    const ConstBlock block(A.Diagonal(b), A.size(b), A.size(b));
    dense.block(A.offset(b), A.offset(b), A.size(b), A.size(b)) =
        block.selfadjointView<Eigen::Lower>();
  }
  for (int index = 0; index < A.num_off_diagonal(); ++index) {
    const auto [i, j] = A.coupled(index);
    const ConstBlock block(A.OffDiagonal(index), A.size(i), A.size(j));
    dense.block(A.offset(i), A.offset(j), A.size(i), A.size(j)) = block;
    dense.block(A.offset(j), A.offset(i), A.size(j), A.size(i)) = block.transpose();
  }
  return dense;
}

inline Eigen::VectorXd RandomVector(int rows, Random& random) {
  return Eigen::VectorXd::NullaryExpr(rows, [&] { return random.Normal(); });
}

}  // namespace dqslam
