#include "firmware_host/graph/node.hpp"

#include <algorithm>
#include <cassert>

namespace swiftlet {
namespace {

template <typename List>
void addOnce(List& list, Node& node) {
  if (std::find(list.begin(), list.end(), &node) != list.end()) return;
  const bool added = list.tryPushBack(&node);
  assert(added);
  static_cast<void>(added);
}

}  // namespace

In::In(Node& reader, const char* counter, Arrow arrow) : reader_(reader), counter_(counter), arrow_(arrow) {
  const bool added = reader.ins_.tryPushBack(this);
  assert(added);
  static_cast<void>(added);
}

void connect(Node& writer, In& in) {
  const Arrow arrow = in.arrow();
  if (arrow == Arrow::kWakes || arrow == Arrow::kFeedback) addOnce(writer.woken_, in.reader());
  if (arrow == Arrow::kWakes || arrow == Arrow::kWaits) addOnce(in.reader().before_, writer);
}

void Node::addLosses(std::map<std::string, std::uint64_t>& losses) const {
  for (const In* in : ins_) {
    if (in->lost() > 0 && in->counter() != nullptr) losses[in->counter()] += in->lost();
  }
}

bool Node::inputEnded() const {
  return std::all_of(before_.begin(), before_.end(), [](const Node* node) { return node->done(); });
}

}  // namespace swiftlet
