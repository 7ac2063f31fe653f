#include "mapping/pose_graph/block_cholesky.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace swiftlet {
namespace {

using Eigen::Index;
using Front = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
using ConstFront = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

// Small fronts are eliminated column by column, because Eigen's blocked kernels would spend more on packing
// than on arithmetic.
constexpr Index kNarrow = 12;  // columns to eliminate, at most
constexpr Index kLow = 48;     // rows in all, at most

/// Right-looking elimination of the first `columns` of a front kept in two parts: the panel (height x
/// columns) and the update (lower triangle of the rows below).
bool eliminateNarrow(double* panel, Index height, Index columns, double* update) {
  for (Index k = 0; k < columns; ++k) {
    double* pivot_column = panel + k * height;
    const double pivot = pivot_column[k];
    if (!(pivot > 0)) return false;
    const double scale = 1.0 / std::sqrt(pivot);
    for (Index r = k; r < height; ++r) pivot_column[r] *= scale;
    for (Index c = k + 1; c < columns; ++c) {
      double* column = panel + c * height;
      const double factor = pivot_column[c];
      for (Index r = c; r < height; ++r) column[r] -= factor * pivot_column[r];
    }
  }
  const Index rows = height - columns;
  for (Index c = 0; c < rows; ++c) {
    double* column = update + c * rows;
    for (Index k = 0; k < columns; ++k) {
      const double* below = panel + k * height + columns;
      const double factor = below[c];
      for (Index r = c; r < rows; ++r) column[r] -= factor * below[r];
    }
  }
  return true;
}

bool eliminateWide(double* panel, Index height, Index columns, double* update) {
  const Index rows = height - columns;
  Front top(panel, columns, columns, Eigen::OuterStride<>(height));
  Eigen::Ref<Eigen::MatrixXd, 0, Eigen::OuterStride<>> top_ref(top);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd, 0, Eigen::OuterStride<>>> llt(top_ref);
  // Eigen accepts NaN as a pivot.
  if (llt.info() != Eigen::Success || !(top.diagonal().array() > 0).all()) return false;
  if (rows == 0) return true;
  Front bottom(panel + columns, rows, columns, Eigen::OuterStride<>(height));
  top.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(bottom);
  Front remainder(update, rows, rows, Eigen::OuterStride<>(rows));
  remainder.selfadjointView<Eigen::Lower>().rankUpdate(bottom, -1.0);
  return true;
}

}  // namespace

template <int kBlock>
std::size_t BlockCholesky<kBlock>::values(const BlockStructure& structure) {
  return (structure.panelBlocks() + structure.stackBlocks()) * kBlock * kBlock;
}

template <int kBlock>
void BlockCholesky<kBlock>::prepare(const BlockStructure& structure) {
  structure_ = &structure;
  panel_values_ = structure.panelBlocks() * kBlock * kBlock;
  memory_.resize(values(structure));
}

template <int kBlock>
void BlockCholesky<kBlock>::gather(const BlockMatrix<kBlock>& matrix, const Eigen::VectorXd& damping) {
  std::fill_n(memory_.begin(), panel_values_, 0.0);
  const auto nodes = structure_->nodes();
  const auto blockAt = [&](const FrontNode& node, std::uint32_t row, std::uint32_t column) {
    const auto height = static_cast<Index>(node.height()) * kBlock;
    double* begin =
        memory_.data() + node.panel_begin * kBlock * kBlock + column * kBlock * height + row * kBlock;
    return Eigen::Map<typename BlockMatrix<kBlock>::Block, 0, Eigen::OuterStride<>>(
        begin, Eigen::OuterStride<>(height));
  };
  for (std::uint32_t k = 0; k < matrix.diagonal.size(); ++k) {
    const FrontNode& node = nodes[structure_->nodeOf(k)];
    const std::uint32_t column = structure_->place(k) - node.first_column;
    auto block = blockAt(node, column, column);
    block = matrix.diagonal[k];
    if (damping.size() > 0) block.diagonal() += damping.segment<kBlock>(static_cast<Index>(k) * kBlock);
  }
  const auto slots = structure_->slots();
  for (std::size_t k = 0; k < matrix.pairs.size(); ++k) {
    auto block = blockAt(nodes[slots[k].node], slots[k].row, slots[k].column);
    if (slots[k].transposed) {
      block = matrix.pairs[k].transpose();
    } else {
      block = matrix.pairs[k];
    }
  }
}

template <int kBlock>
void BlockCholesky<kBlock>::addChild(const FrontNode& child, const FrontNode& node, const double* update,
                                     double* panel, double* own_update) const {
  const auto to = structure_->parentRows().subspan(child.rows_begin, child.rows);
  const Index child_height = static_cast<Index>(child.rows) * kBlock;
  const Index height = static_cast<Index>(node.height()) * kBlock;
  const Index rows = static_cast<Index>(node.rows) * kBlock;
  for (std::uint32_t c = 0; c < child.rows; ++c) {
    const bool in_panel = to[c] < node.columns;
    const Index step = in_panel ? height : rows;
    double* column = in_panel ? panel + static_cast<Index>(to[c]) * kBlock * height
                              : own_update + static_cast<Index>(to[c] - node.columns) * kBlock * rows;
    const Index shift = in_panel ? 0 : static_cast<Index>(node.columns) * kBlock;
    for (std::uint32_t r = c; r < child.rows; ++r) {
      const double* from =
          update + static_cast<Index>(c) * kBlock * child_height + static_cast<Index>(r) * kBlock;
      double* into = column + static_cast<Index>(to[r]) * kBlock - shift;
      for (int j = 0; j < kBlock; ++j) {
        for (int i = 0; i < kBlock; ++i) into[j * step + i] += from[j * child_height + i];
      }
    }
  }
}

template <int kBlock>
bool BlockCholesky<kBlock>::eliminate(double* panel, Index height, Index columns, double* update) {
  if (columns <= kNarrow && height <= kLow) return eliminateNarrow(panel, height, columns, update);
  return eliminateWide(panel, height, columns, update);
}

template <int kBlock>
bool BlockCholesky<kBlock>::factor(const BlockMatrix<kBlock>& matrix, const Eigen::VectorXd& damping) {
  gather(matrix, damping);
  constexpr std::size_t kArea = kBlock * kBlock;
  const auto nodes = structure_->nodes();
  // Updates lie in postorder, so those of a node's children are the newest: the last child on top.
  std::vector<std::uint32_t>& waiting = waiting_;
  waiting.clear();
  double* const stack = memory_.data() + panel_values_;
  std::size_t top = 0;
  for (std::uint32_t k = 0; k < nodes.size(); ++k) {
    const FrontNode& node = nodes[k];
    double* panel = memory_.data() + node.panel_begin * kArea;
    const std::size_t own = std::size_t{node.rows} * node.rows * kArea;
    double* update = stack + top;
    std::fill(update, update + own, 0.0);
    std::size_t base = top;
    for (std::uint32_t c = 0; c < node.children; ++c) {
      const FrontNode& child = nodes[waiting[waiting.size() - 1 - c]];
      base -= std::size_t{child.rows} * child.rows * kArea;
      addChild(child, node, stack + base, panel, update);
    }
    waiting.resize(waiting.size() - node.children);
    if (!eliminate(panel, static_cast<Index>(node.height()) * kBlock,
                   static_cast<Index>(node.columns) * kBlock, update)) {
      return false;
    }
    if (node.parent == FrontNode::kNoParent) {
      top = base;
      continue;
    }
    if (base != top) std::copy(update, update + own, stack + base);
    top = base + own;
    waiting.push_back(k);
  }
  return true;
}

template <int kBlock>
void BlockCholesky<kBlock>::solve(Eigen::Ref<Eigen::MatrixXd> x) {
  const Index sides = x.cols();
  const auto nodes = structure_->nodes();
  const auto rows = structure_->rows();
  ordered_.resize(x.rows(), sides);
  for (std::uint32_t k = 0; k < structure_->blocks(); ++k) {
    ordered_.middleRows<kBlock>(static_cast<Index>(structure_->place(k)) * kBlock) =
        x.middleRows<kBlock>(static_cast<Index>(k) * kBlock);
  }
  const auto parts = [&](const FrontNode& node) {
    const Index height = static_cast<Index>(node.height()) * kBlock;
    const Index columns = static_cast<Index>(node.columns) * kBlock;
    const double* panel = memory_.data() + node.panel_begin * kBlock * kBlock;
    return std::pair(ConstFront(panel, columns, columns, Eigen::OuterStride<>(height)),
                     ConstFront(panel + columns, height - columns, columns, Eigen::OuterStride<>(height)));
  };
  for (const FrontNode& node : nodes) {
    const auto [top, bottom] = parts(node);
    auto own = ordered_.middleRows(static_cast<Index>(node.first_column) * kBlock, top.rows());
    top.template triangularView<Eigen::Lower>().solveInPlace(own);
    if (node.rows == 0) continue;
    below_.noalias() = bottom * own;
    for (std::uint32_t r = 0; r < node.rows; ++r) {
      ordered_.middleRows<kBlock>(static_cast<Index>(rows[node.rows_begin + r]) * kBlock) -=
          below_.middleRows<kBlock>(static_cast<Index>(r) * kBlock);
    }
  }
  for (std::size_t k = nodes.size(); k-- > 0;) {
    const FrontNode& node = nodes[k];
    const auto [top, bottom] = parts(node);
    auto own = ordered_.middleRows(static_cast<Index>(node.first_column) * kBlock, top.rows());
    if (node.rows > 0) {
      below_.resize(static_cast<Index>(node.rows) * kBlock, sides);
      for (std::uint32_t r = 0; r < node.rows; ++r) {
        below_.middleRows<kBlock>(static_cast<Index>(r) * kBlock) =
            ordered_.middleRows<kBlock>(static_cast<Index>(rows[node.rows_begin + r]) * kBlock);
      }
      own.noalias() -= bottom.transpose() * below_;
    }
    top.template triangularView<Eigen::Lower>().transpose().solveInPlace(own);
  }
  for (std::uint32_t k = 0; k < structure_->blocks(); ++k) {
    x.middleRows<kBlock>(static_cast<Index>(k) * kBlock) =
        ordered_.middleRows<kBlock>(static_cast<Index>(structure_->place(k)) * kBlock);
  }
}

template class BlockCholesky<1>;
template class BlockCholesky<2>;
template class BlockCholesky<3>;
template class BlockCholesky<6>;

}  // namespace swiftlet
