#include "mapping/pose_graph/block_structure.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "mapping/pose_graph/block_ordering.hpp"

namespace swiftlet {

constexpr std::uint32_t kNone = FrontNode::kNoParent;

/// A supernode while nodes are found and merged. Columns and rows are places.
struct FrontDraft {
  std::uint32_t last_column = 0;  ///< its own columns before merging: first_column to last_column
  std::uint32_t first_column = 0;
  std::uint32_t columns = 0;  ///< with those of merged children
  std::uint32_t parent = kNone;
  std::uint32_t merged_into = kNone;
  std::uint32_t rows_begin = 0;
  std::uint32_t rows = 0;
  double zeros = 0;
};

namespace {

// A child is merged into its parent if the zeros of the merged node are at most this share of its blocks; the
// first rule with enough columns applies. Few wide fronts beat many narrow ones until the zeros cost more
// than they save.
struct Relaxation {
  std::uint32_t columns;
  double zeros;
};
constexpr Relaxation kRelaxation[] = {
    {2, 0.5}, {8, 0.25}, {16, 0.1}, {std::numeric_limits<std::uint32_t>::max(), 0.05}};

// Nested dissection is tried, too, above this number of block multiplications per block. Below, it costs more
// time than it saves: on the public graphs it takes 2 to 4 us a block and saves a third of the work on
// spheres and tori (1400 to 2200 per block), a tenth or nothing on all others (below 800).
constexpr double kWorthDissecting = 1000;

/// Compressed lists: of item k, values[begin[k]] to values[begin[k + 1] - 1].
struct Lists {
  std::vector<std::uint32_t> begin;
  std::vector<std::uint32_t> values;
  [[nodiscard]] std::span<const std::uint32_t> of(std::size_t k) const {
    return {values.data() + begin[k], begin[k + 1] - begin[k]};
  }
};

/// For each column, the rows of the matrix below it (below = true), or for each row the columns left of it.
Lists triangle(std::uint32_t blocks, std::span<const BlockPair> pairs, std::span<const std::uint32_t> place,
               bool below) {
  Lists lists;
  lists.begin.assign(blocks + 1, 0);
  lists.values.resize(pairs.size());
  const auto ends = [&](const BlockPair& pair) {
    const auto [low, high] = std::minmax(place[pair.first], place[pair.second]);
    return below ? BlockPair{low, high} : BlockPair{high, low};
  };
  for (const BlockPair& pair : pairs) ++lists.begin[ends(pair).first + 1];
  for (std::uint32_t k = 0; k < blocks; ++k) lists.begin[k + 1] += lists.begin[k];
  std::vector<std::uint32_t> next(lists.begin.begin(), lists.begin.end() - 1);
  for (const BlockPair& pair : pairs) {
    const auto [list, value] = ends(pair);
    lists.values[next[list]++] = value;
  }
  return lists;
}

std::vector<std::uint32_t> eliminationTree(std::uint32_t blocks, const Lists& left) {
  std::vector<std::uint32_t> parent(blocks, kNone);
  std::vector<std::uint32_t> ancestor(blocks, kNone);
  for (std::uint32_t row = 0; row < blocks; ++row) {
    for (std::uint32_t k : left.of(row)) {
      while (k != kNone && k < row) {
        const std::uint32_t next = ancestor[k];
        ancestor[k] = row;
        if (next == kNone) parent[k] = row;
        k = next;
      }
    }
  }
  return parent;
}

Lists childrenOf(std::span<const std::uint32_t> parent) {
  Lists lists;
  lists.begin.assign(parent.size() + 1, 0);
  for (const std::uint32_t p : parent) {
    if (p != kNone) ++lists.begin[p + 1];
  }
  for (std::size_t k = 0; k < parent.size(); ++k) lists.begin[k + 1] += lists.begin[k];
  lists.values.resize(lists.begin.back());
  std::vector<std::uint32_t> next(lists.begin.begin(), lists.begin.end() - 1);
  for (std::uint32_t k = 0; k < parent.size(); ++k) {
    if (parent[k] != kNone) lists.values[next[parent[k]]++] = k;
  }
  return lists;
}

/// Children before parents, each subtree in one piece; roots in rising order.
std::vector<std::uint32_t> postorder(std::span<const std::uint32_t> parent) {
  const Lists children = childrenOf(parent);
  std::vector<std::uint32_t> order;
  order.reserve(parent.size());
  std::vector<std::uint32_t> stack;
  std::vector<std::uint32_t> next(children.begin.begin(), children.begin.end() - 1);
  for (std::uint32_t root = 0; root < parent.size(); ++root) {
    if (parent[root] != kNone) continue;
    stack.push_back(root);
    while (!stack.empty()) {
      const std::uint32_t at = stack.back();
      if (next[at] < children.begin[at + 1]) {
        stack.push_back(children.values[next[at]++]);
      } else {
        order.push_back(at);
        stack.pop_back();
      }
    }
  }
  return order;
}

struct Drafts {
  std::vector<FrontDraft> nodes;
  std::vector<std::uint32_t> rows;
};

/// Fundamental supernodes of a postordered matrix with their rows, sorted.
Drafts findSupernodes(std::uint32_t blocks, const Lists& below, std::span<const std::uint32_t> parent) {
  Drafts drafts;
  const Lists children = childrenOf(parent);
  std::vector<std::uint32_t> node_of(blocks, kNone);
  std::vector<std::uint32_t> mark(blocks, kNone);
  std::vector<std::uint32_t> rows;
  for (std::uint32_t column = 0; column < blocks; ++column) {
    rows.clear();
    mark[column] = column;
    const auto take = [&](std::uint32_t row) {
      if (mark[row] == column) return;
      mark[row] = column;
      rows.push_back(row);
    };
    for (const std::uint32_t row : below.of(column)) take(row);
    for (const std::uint32_t child : children.of(column)) {
      const FrontDraft& node = drafts.nodes[node_of[child]];
      for (std::uint32_t k = 0; k < node.rows; ++k) take(drafts.rows[node.rows_begin + k]);
    }
    // If the only child has exactly this column and its rows as rows, its supernode continues.
    if (children.of(column).size() == 1) {
      const std::uint32_t child = children.of(column)[0];
      FrontDraft& node = drafts.nodes[node_of[child]];
      if (child + 1 == column && node.last_column == child && node.rows == rows.size() + 1) {
        node.last_column = column;
        ++node.columns;
        // Its rows are sorted and begin with this column: the rest stays.
        ++node.rows_begin;
        --node.rows;
        node_of[column] = node_of[child];
        continue;
      }
    }
    std::sort(rows.begin(), rows.end());
    FrontDraft node;
    node.first_column = node.last_column = column;
    node.columns = 1;
    node.rows_begin = static_cast<std::uint32_t>(drafts.rows.size());
    node.rows = static_cast<std::uint32_t>(rows.size());
    drafts.rows.insert(drafts.rows.end(), rows.begin(), rows.end());
    node_of[column] = static_cast<std::uint32_t>(drafts.nodes.size());
    drafts.nodes.push_back(node);
  }
  for (FrontDraft& node : drafts.nodes) {
    if (node.rows > 0) node.parent = node_of[drafts.rows[node.rows_begin]];
  }
  return drafts;
}

double trapezoid(double columns, double rows) { return columns * (columns + 1) / 2 + columns * rows; }

bool worthMerging(std::uint32_t columns, std::uint32_t rows, double zeros) {
  for (const Relaxation& rule : kRelaxation) {
    if (columns <= rule.columns) return zeros <= rule.zeros * trapezoid(columns, rows);
  }
  return false;
}

void relax(std::vector<FrontDraft>& nodes) {
  std::vector<std::uint32_t> parent(nodes.size());
  for (std::size_t k = 0; k < nodes.size(); ++k) parent[k] = nodes[k].parent;
  const Lists children = childrenOf(parent);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    FrontDraft& node = nodes[k];
    // The last child first: its rows are most like the parent's.
    const auto list = children.of(k);
    for (std::size_t c = list.size(); c-- > 0;) {
      FrontDraft& child = nodes[list[c]];
      const double zeros = child.zeros + node.zeros +
                           static_cast<double>(child.columns) * (node.columns + node.rows - child.rows);
      if (!worthMerging(child.columns + node.columns, node.rows, zeros)) continue;
      node.columns += child.columns;
      node.zeros = zeros;
      child.merged_into = static_cast<std::uint32_t>(k);
    }
  }
}

}  // namespace

void BlockStructure::analyze(std::uint32_t blocks, std::span<const BlockPair> pairs) {
  *this = {};
  std::vector<std::uint32_t> order;
  if (!orderBlocks(BlockOrdering::kMinimumDegree, blocks, pairs, order)) {
    order.resize(blocks);
    std::iota(order.begin(), order.end(), 0U);
  }
  build(order, pairs);
  if (work_ > kWorthDissecting * blocks &&
      orderBlocks(BlockOrdering::kNestedDissection, blocks, pairs, order)) {
    BlockStructure dissected;
    dissected.build(order, pairs);
    if (dissected.work_ < work_) *this = std::move(dissected);
  }
  placeSlots(pairs);
}

void BlockStructure::build(std::span<const std::uint32_t> order, std::span<const BlockPair> pairs) {
  const auto blocks = static_cast<std::uint32_t>(order.size());
  place_.resize(blocks);
  for (std::uint32_t k = 0; k < blocks; ++k) place_[order[k]] = k;
  std::vector<std::uint32_t> parent = eliminationTree(blocks, triangle(blocks, pairs, place_, false));
  // The same elimination, postordered.
  const std::vector<std::uint32_t> post = postorder(parent);
  std::vector<std::uint32_t> rank(blocks);
  for (std::uint32_t k = 0; k < blocks; ++k) rank[post[k]] = k;
  std::vector<std::uint32_t> post_parent(blocks);
  for (std::uint32_t k = 0; k < blocks; ++k) {
    const std::uint32_t p = parent[post[k]];
    post_parent[k] = p == kNone ? kNone : rank[p];
  }
  for (std::uint32_t& place : place_) place = rank[place];
  Drafts drafts = findSupernodes(blocks, triangle(blocks, pairs, place_, true), post_parent);
  relax(drafts.nodes);
  number(drafts.nodes, drafts.rows);
  measure();
}

void BlockStructure::number(std::span<const FrontDraft> drafts, std::span<const std::uint32_t> draft_rows) {
  // Indices of drafts rise from children to parents, so a merged chain is followed from its end.
  std::vector<std::uint32_t> kept(drafts.size());
  for (std::size_t k = drafts.size(); k-- > 0;) {
    kept[k] = drafts[k].merged_into == kNone ? static_cast<std::uint32_t>(k) : kept[drafts[k].merged_into];
  }
  std::vector<std::uint32_t> number(drafts.size(), kNone);
  std::uint32_t next_column = 0;
  for (std::size_t k = 0; k < drafts.size(); ++k) {
    if (kept[k] != k) continue;
    number[k] = static_cast<std::uint32_t>(nodes_.size());
    FrontNode node;
    node.first_column = next_column;
    node.columns = drafts[k].columns;
    node.rows = drafts[k].rows;
    next_column += node.columns;
    nodes_.push_back(node);
  }
  std::vector<std::uint32_t> renamed(place_.size());
  std::vector<std::uint32_t> filled(nodes_.size(), 0);
  node_of_.resize(place_.size());
  for (std::size_t k = 0; k < drafts.size(); ++k) {
    const std::uint32_t at = number[kept[k]];
    for (std::uint32_t column = drafts[k].first_column; column <= drafts[k].last_column; ++column) {
      renamed[column] = nodes_[at].first_column + filled[at]++;
      node_of_[renamed[column]] = at;
    }
  }
  for (std::uint32_t& place : place_) place = renamed[place];
  for (std::size_t k = 0; k < drafts.size(); ++k) {
    if (kept[k] != k) continue;
    FrontNode& node = nodes_[number[k]];
    node.rows_begin = static_cast<std::uint32_t>(rows_.size());
    for (std::uint32_t r = 0; r < node.rows; ++r) {
      rows_.push_back(renamed[draft_rows[drafts[k].rows_begin + r]]);
    }
    std::sort(rows_.begin() + node.rows_begin, rows_.end());
    if (node.rows > 0) node.parent = node_of_[rows_[node.rows_begin]];
  }
  parent_rows_.resize(rows_.size());
  for (const FrontNode& node : nodes_) {
    if (node.parent == kNone) continue;
    FrontNode& parent = nodes_[node.parent];
    ++parent.children;
    std::uint32_t at = 0;
    for (std::uint32_t r = node.rows_begin; r < node.rows_begin + node.rows; ++r) {
      if (rows_[r] < parent.first_column + parent.columns) {
        parent_rows_[r] = rows_[r] - parent.first_column;
        continue;
      }
      while (rows_[parent.rows_begin + at] < rows_[r]) ++at;
      parent_rows_[r] = parent.columns + at;
    }
  }
}

void BlockStructure::placeSlots(std::span<const BlockPair> pairs) {
  slots_.clear();
  slots_.reserve(pairs.size());
  for (const auto& [first, second] : pairs) {
    const std::uint32_t a = place_[first];
    const std::uint32_t b = place_[second];
    const std::uint32_t low = std::min(a, b);
    const std::uint32_t high = std::max(a, b);
    BlockSlot slot;
    slot.node = node_of_[low];
    const FrontNode& node = nodes_[slot.node];
    slot.column = low - node.first_column;
    slot.transposed = b > a;
    if (high < node.first_column + node.columns) {
      slot.row = high - node.first_column;
    } else {
      const auto begin = rows_.begin() + node.rows_begin;
      slot.row =
          node.columns + static_cast<std::uint32_t>(std::lower_bound(begin, begin + node.rows, high) - begin);
    }
    slots_.push_back(slot);
  }
}

void BlockStructure::measure() {
  panel_blocks_ = 0;
  stack_blocks_ = 0;
  work_ = 0;
  std::size_t top = 0;
  std::vector<std::size_t> held(nodes_.size(), 0);  // blocks of its children's updates
  for (FrontNode& node : nodes_) {
    node.panel_begin = panel_blocks_;
    panel_blocks_ += std::size_t{node.height()} * node.columns;
    const std::size_t update = std::size_t{node.rows} * node.rows;
    stack_blocks_ = std::max(stack_blocks_, top + update);
    top += update - held[static_cast<std::size_t>(&node - nodes_.data())];
    if (node.parent != kNone) held[node.parent] += update;
    for (std::uint32_t c = 0; c < node.columns; ++c) {
      const double height = node.height() - c;
      work_ += height * height;
    }
  }
}

}  // namespace swiftlet
