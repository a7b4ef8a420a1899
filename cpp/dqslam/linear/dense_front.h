// The arithmetic within one front of a multifrontal Cholesky factorization.
#pragma once

namespace dqslam {

/// EliminatePivots reads this many values past the end of `factor`, but does not use them.
inline constexpr int kFrontPadding = 3;

/// Eliminates the pivots, which are the first `columns` of `rows` rows, in place. All matrices are
/// column-major; only the lower triangle of a symmetric matrix is read and written.
///
///   factor  rows x columns. It holds columns of the matrix on entry and of its Cholesky factor L
///           on return.
///   update  square, with rows - columns rows. L21 L21^T is subtracted from it, where L21 is the
///           part of L below the pivots.
///
/// Returns false when a pivot is not a positive finite number.
bool EliminatePivots(int columns, int rows, double* factor, double* update);

}  // namespace dqslam
