#include "dqslam/linear/dense_front.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace dqslam {
namespace {

// Fronts have a few dozen rows and a few pivots. That is too small for Eigen's products, which
// first copy their operands. A tile and its sum fit into the registers that every x86-64 has.
constexpr int kTile = 4;
using Tile = Eigen::Matrix<double, kTile, kTile>;
using TileColumn = Eigen::Map<const Eigen::Matrix<double, kTile, 1>>;
static_assert(kFrontPadding == kTile - 1);

// target(i, j) -= sum_k L(i, k) L(j, k) for j <= i < rows, j < columns, k < depth. Tiles on the
// border or on the diagonal compute more than that; the rest is dropped or lands above the
// diagonal.
void SubtractProduct(const double* L,
                     int depth,
                     int rows,
                     int columns,
                     int stride,
                     double* target,
                     int target_stride) {
  for (int j = 0; j < columns; j += kTile) {
    for (int i = j; i < rows; i += kTile) {
      Tile product = Tile::Zero();
      const double* column = L;
      for (int k = 0; k < depth; ++k, column += stride) {
        product.noalias() += TileColumn(column + i) * TileColumn(column + j).transpose();
      }
      double* corner = target + std::ptrdiff_t{j} * target_stride + i;
      const int height = std::min(kTile, rows - i), width = std::min(kTile, columns - j);
      if (height == kTile && width == kTile) {
        Eigen::Map<Tile, 0, Eigen::OuterStride<>>(corner, Eigen::OuterStride<>(target_stride)) -=
            product;
      } else {
        for (int c = 0; c < width; ++c) {
          for (int r = 0; r < height; ++r) {
            corner[std::ptrdiff_t{c} * target_stride + r] -= product(r, c);
          }
        }
      }
    }
  }
}

}  // namespace

bool EliminatePivots(int columns, int rows, double* factor, double* update) {
  const auto Column = [&](int c) { return factor + std::ptrdiff_t{c} * rows; };
  for (int first = 0; first < columns; first += kTile) {
    const int last = std::min(columns, first + kTile);
    SubtractProduct(
        factor + first, first, rows - first, last - first, rows, Column(first) + first, rows);
    for (int c = first; c < last; ++c) {
      Eigen::Map<Eigen::VectorXd> below(Column(c) + c, rows - c);
      for (int k = first; k < c; ++k) {
        const double* earlier = Column(k) + c;
        below -= *earlier * Eigen::Map<const Eigen::VectorXd>(earlier, rows - c);
      }
      const double pivot = below[0];
      if (!(pivot > 0 && std::isfinite(pivot))) return false;
      below *= 1 / std::sqrt(pivot);
    }
  }
  const int below = rows - columns;
  SubtractProduct(factor + columns, columns, below, below, rows, update, below);
  return true;
}

}  // namespace dqslam
