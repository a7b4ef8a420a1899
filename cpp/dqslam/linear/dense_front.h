// The arithmetic within one front of a multifrontal Cholesky factorization.
#pragma once

namespace dqslam {

/// How far past the end of `factor` EliminatePivots reads, whatever is there.
inline constexpr int kFrontPadding = 3;

/// Eliminates the `columns` pivots, the first of `rows` rows, in place. All matrices are
/// column-major, of symmetric ones only the lower triangle is read and meant.
///
///   factor  rows x columns: of the matrix in, of its Cholesky factor L out
///   update  (rows - columns) squared: has L21 L21^T subtracted, L21 being L below the pivots
///
/// False when a pivot is not a positive finite number.
bool EliminatePivots(int columns, int rows, double* factor, double* update);

}  // namespace dqslam
