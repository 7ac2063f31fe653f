#pragma once
// Normal equations of a long chain of local unknowns and a few global ones: an arrow matrix.
//
// Solves H x = -g with H = [A B; B^T C]. A is banded (the spline's controls and the biases, in order of
// time), the border (calibration) is dense. Cholesky of A without pivoting, then of the Schur complement C -
// B^T A^-1 B, which is the information on the border with the chain marginalized. Cost: chain (width^2 +
// width border) multiplications, 0.1 s for 10,000 unknowns. Memory: 8 (width + border) bytes per unknown,
// twice. Source: George, Liu, "Computer Solution of Large Sparse Positive Definite Systems", 1981, chapter 4.

#include <Eigen/Core>
#include <cstddef>
#include <span>

namespace swiftlet {

class ArrowSystem {
 public:
  /// `rights`: number of gradients (right-hand sides).
  ArrowSystem(int chain, int width, int border, int rights = 1);

  [[nodiscard]] int chain() const { return static_cast<int>(band_.cols()); }
  [[nodiscard]] int border() const { return static_cast<int>(corner_.cols()); }
  void clear();
  /// Adds a dense block. `columns`: unknowns of the chain, or chain() + those of the border; unknowns of the
  /// chain are at most `width` apart.
  void add(std::span<const int> columns, const Eigen::Ref<const Eigen::MatrixXd>& H,
           const Eigen::Ref<const Eigen::MatrixXd>& g);
  /// Adds another system; if it has fewer gradients, they are added to the first ones.
  void add(const ArrowSystem& other);
  /// Fixes an unknown of the border: its step is zero.
  void hold(int border_column);

  [[nodiscard]] Eigen::VectorXd gradient(int right = 0) const;

 private:
  friend class ArrowFactor;
  Eigen::MatrixXd band_;    ///< (i - j, j) for i >= j
  Eigen::MatrixXd border_;  ///< one column per unknown of the chain
  Eigen::MatrixXd corner_;
  Eigen::MatrixXd gradient_;  ///< of the chain, then of the border
};

class ArrowFactor {
 public:
  /// Diagonals are multiplied by 1 + `damping`.
  ArrowFactor(const ArrowSystem& system, double damping);

  [[nodiscard]] bool ok() const { return ok_; }  ///< positive definite
  /// x of H x = right.
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& right) const;
  /// Covariance of the border, followed by that of functionals of the chain (columns of `functionals`).
  [[nodiscard]] Eigen::MatrixXd covariance(const Eigen::MatrixXd& functionals) const;

 private:
  /// y of L y = right, in place.
  void forward(Eigen::VectorXd& chain) const;

  bool ok_ = true;
  Eigen::MatrixXd band_;    ///< L of A
  Eigen::MatrixXd border_;  ///< L^-1 B, one column per unknown of the chain
  Eigen::MatrixXd corner_;  ///< L of the Schur complement
};

}  // namespace swiftlet
