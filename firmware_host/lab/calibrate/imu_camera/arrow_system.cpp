#include "firmware_host/lab/calibrate/imu_camera/arrow_system.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdlib>

namespace swiftlet {

ArrowSystem::ArrowSystem(int chain, int width, int border, int rights)
    : band_(width + 1, chain),
      border_(border, chain),
      corner_(border, border),
      gradient_(chain + border, rights) {
  clear();
}

void ArrowSystem::clear() {
  band_.setZero();
  border_.setZero();
  corner_.setZero();
  gradient_.setZero();
}

void ArrowSystem::add(std::span<const int> columns, const Eigen::Ref<const Eigen::MatrixXd>& H,
                      const Eigen::Ref<const Eigen::MatrixXd>& g) {
  const int count = static_cast<int>(columns.size());
  for (int a = 0; a < count; ++a) {
    const int i = columns[static_cast<std::size_t>(a)];
    const bool in_chain = i < chain();
    gradient_.row(i).head(g.cols()) += g.row(a);
    for (int b = 0; b < count; ++b) {
      const int j = columns[static_cast<std::size_t>(b)];
      if (in_chain) {
        if (j < chain()) {
          assert(std::abs(j - i) < band_.rows());
          if (j >= i) band_(j - i, i) += H(b, a);
        } else {
          border_(j - chain(), i) += H(b, a);
        }
      } else if (j >= chain()) {
        corner_(j - chain(), i - chain()) += H(b, a);
      }
    }
  }
}

void ArrowSystem::add(const ArrowSystem& other) {
  band_ += other.band_;
  border_ += other.border_;
  corner_ += other.corner_;
  gradient_.leftCols(other.gradient_.cols()) += other.gradient_;
}

void ArrowSystem::hold(int border_column) {
  border_.row(border_column).setZero();
  corner_.row(border_column).setZero();
  corner_.col(border_column).setZero();
  corner_(border_column, border_column) = 1;
  gradient_.row(chain() + border_column).setZero();
}

Eigen::VectorXd ArrowSystem::gradient(int right) const { return gradient_.col(right); }

ArrowFactor::ArrowFactor(const ArrowSystem& system, double damping)
    : band_(system.band_), border_(system.border_), corner_(system.corner_) {
  band_.row(0) *= 1 + damping;
  corner_.diagonal() *= 1 + damping;
  const Eigen::Index chain = band_.cols();
  for (Eigen::Index j = 0; j < chain; ++j) {
    const double pivot = band_(0, j);
    if (!(pivot > 0)) {
      ok_ = false;
      return;
    }
    const double inverse = 1 / std::sqrt(pivot);
    band_.col(j) *= inverse;
    border_.col(j) *= inverse;
    const Eigen::Index below = std::min<Eigen::Index>(band_.rows() - 1, chain - 1 - j);
    for (Eigen::Index k = 1; k <= below; ++k) {
      const double factor = band_(k, j);
      if (factor == 0) continue;
      band_.col(j + k).head(below - k + 1) -= factor * band_.col(j).segment(k, below - k + 1);
      border_.col(j + k) -= factor * border_.col(j);
    }
  }
  corner_.noalias() -= border_ * border_.transpose();
  const Eigen::LLT<Eigen::MatrixXd> schur(corner_);
  ok_ = schur.info() == Eigen::Success;
  corner_ = schur.matrixL();
}

void ArrowFactor::forward(Eigen::VectorXd& chain) const {
  for (Eigen::Index j = 0; j < chain.size(); ++j) {
    chain[j] /= band_(0, j);
    const Eigen::Index below = std::min<Eigen::Index>(band_.rows() - 1, chain.size() - 1 - j);
    chain.segment(j + 1, below) -= chain[j] * band_.col(j).segment(1, below);
  }
}

Eigen::VectorXd ArrowFactor::solve(const Eigen::VectorXd& right) const {
  const Eigen::Index chain = band_.cols();
  Eigen::VectorXd x = right.head(chain);
  forward(x);
  Eigen::VectorXd border = right.tail(corner_.rows()) - border_ * x;
  const auto L = corner_.triangularView<Eigen::Lower>();
  L.solveInPlace(border);
  L.transpose().solveInPlace(border);
  x.noalias() -= border_.transpose() * border;
  for (Eigen::Index j = chain; j-- > 0;) {
    const Eigen::Index below = std::min<Eigen::Index>(band_.rows() - 1, chain - 1 - j);
    x[j] = (x[j] - band_.col(j).segment(1, below).dot(x.segment(j + 1, below))) / band_(0, j);
  }
  Eigen::VectorXd all(right.size());
  all << x, border;
  return all;
}

Eigen::MatrixXd ArrowFactor::covariance(const Eigen::MatrixXd& functionals) const {
  const Eigen::Index border = corner_.rows();
  const Eigen::Index extra = functionals.cols();
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(border, border);
  const auto L = corner_.triangularView<Eigen::Lower>();
  L.solveInPlace(inverse);
  const Eigen::MatrixXd of_border = inverse.transpose() * inverse;
  Eigen::MatrixXd U(functionals.rows(), extra);
  for (Eigen::Index k = 0; k < extra; ++k) {
    Eigen::VectorXd u = functionals.col(k);
    forward(u);
    U.col(k) = u;
  }
  const Eigen::MatrixXd V = border_ * U;  // B^T A^-1 w
  Eigen::MatrixXd all(border + extra, border + extra);
  all.topLeftCorner(border, border) = of_border;
  all.topRightCorner(border, extra) = -of_border * V;
  all.bottomLeftCorner(extra, border) = all.topRightCorner(border, extra).transpose();
  all.bottomRightCorner(extra, extra) = U.transpose() * U + V.transpose() * of_border * V;
  return all;
}

}  // namespace swiftlet
