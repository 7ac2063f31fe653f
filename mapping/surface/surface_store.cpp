#include "mapping/surface/surface_store.hpp"

#include <algorithm>
#include <cstring>

namespace swiftlet {
namespace {

/// A full store drops 1 / kLeavingShare of its entries at once.
constexpr std::size_t kLeavingShare = 32;
/// A block that a flat surface crosses has some 80 vertices and 130 triangles.
constexpr std::size_t kUsualPages = 11;

std::size_t pageCount(std::size_t items, std::size_t each) { return (items + each - 1) / each; }

}  // namespace

static_assert(sizeof(SurfaceVertex) == 20 && sizeof(SurfaceTriangle) == 6);

SurfaceStore::SurfaceStore(std::size_t bytes, double block_size)
    : block_size_(static_cast<float>(block_size)), hash_(1) {
  static_assert(kPageTriangles * sizeof(SurfaceTriangle) <= sizeof(Page));
  constexpr std::size_t kEach = kUsualPages * (sizeof(Page) + sizeof(std::uint32_t)) + sizeof(Entry) +
                                sizeof(std::uint32_t) + sizeof(Farness);
  std::size_t entries = std::max<std::size_t>(bytes / kEach, 1);
  while (entries > 1 && entries * kEach + BlockHash::bytesFor(entries) > bytes) {
    entries -= std::max<std::size_t>(entries / 64, 1);
  }
  hash_ = BlockHash(entries);
  entries_.resize(entries);
  unused_entries_.reserve(entries);
  far_.resize(entries);
  page_.resize(std::max(entries * kUsualPages, pagesFor(kMostPatchVertices, kMostPatchTriangles)));
  next_.resize(page_.size());
  clear();
}

void SurfaceStore::clear() {
  hash_.clear();
  std::fill(entries_.begin(), entries_.end(), Entry{});
  unused_entries_.clear();
  for (std::size_t i = entries_.size(); i-- > 0;) unused_entries_.push_back(static_cast<std::uint32_t>(i));
  for (std::size_t i = 0; i < next_.size(); ++i) next_[i] = static_cast<std::uint32_t>(i + 1);
  next_.back() = kNone;
  first_free_ = 0;
  free_pages_ = next_.size();
}

std::size_t SurfaceStore::bytes() const {
  return hash_.bytes() + entries_.size() * (sizeof(Entry) + sizeof(std::uint32_t) + sizeof(Farness)) +
         page_.size() * (sizeof(Page) + sizeof(std::uint32_t));
}

std::size_t SurfaceStore::pagesFor(std::size_t vertices, std::size_t triangles) {
  return pageCount(vertices, kPageVertices) + pageCount(triangles, kPageTriangles);
}

SurfaceStore::Farness SurfaceStore::farness(const BlockIndex& block, std::uint32_t entry,
                                            const Eigen::Vector3f& vehicle) const {
  const Eigen::Vector3f centre(static_cast<float>(block.x) + 0.5F, static_cast<float>(block.y) + 0.5F,
                               static_cast<float>(block.z) + 0.5F);
  return {(block_size_ * centre - vehicle).squaredNorm(), keyOf(block), entry};
}

void SurfaceStore::remove(std::uint32_t at) {
  Entry& entry = entries_[at];
  for (std::uint32_t page = entry.first; page != kNone;) {
    const std::uint32_t next = next_[page];
    next_[page] = first_free_;
    first_free_ = page;
    ++free_pages_;
    page = next;
  }
  hash_.erase(keyOf(entry.block));
  entry = Entry{};
  unused_entries_.push_back(at);
}

void SurfaceStore::takeOut(const BlockIndex& block) {
  if (const std::uint32_t old = find(block); old != kNone) remove(old);
}

/// False if `block` itself would be among the dropped ones.
bool SurfaceStore::makeRoom(std::size_t pages, const BlockIndex& block, const Eigen::Vector3f& vehicle) {
  const Farness own = farness(block, kNone, vehicle);
  while (free_pages_ < pages || unused_entries_.empty()) {
    std::size_t count = 0;
    for (std::uint32_t i = 0; i < entries_.size(); ++i) {
      if (entries_[i].triangles > 0) far_[count++] = farness(entries_[i].block, i, vehicle);
    }
    if (count == 0) return false;
    const std::size_t keep = count - std::max<std::size_t>(count / kLeavingShare, 1);
    const auto limit = far_.begin() + static_cast<std::ptrdiff_t>(keep);
    const auto end = far_.begin() + static_cast<std::ptrdiff_t>(count);
    std::nth_element(far_.begin(), limit, end);
    if (*limit < own) return false;
    std::sort(limit, end, [](const Farness& a, const Farness& b) { return b < a; });
    for (auto it = limit; it != end; ++it) {
      remove(it->entry);
      ++counters_.dropped;
    }
  }
  return true;
}

void SurfaceStore::put(const SurfacePatch& patch, const Eigen::Vector3f& vehicle) {
  if (patch.triangles.empty()) {
    takeOut(patch.block);
    return;
  }
  if (const std::uint32_t old = find(patch.block); old != kNone) remove(old);
  const std::size_t pages = pagesFor(patch.vertices.size(), patch.triangles.size());
  if ((free_pages_ < pages || unused_entries_.empty()) && !makeRoom(pages, patch.block, vehicle)) {
    ++counters_.dropped;
    return;
  }
  const std::uint32_t at = unused_entries_.back();
  if (!hash_.insert(keyOf(patch.block), at)) {
    ++counters_.dropped;
    return;
  }
  unused_entries_.pop_back();
  write(patch, entries_[at]);
}

void SurfaceStore::write(const SurfacePatch& patch, Entry& entry) {
  entry.block = patch.block;
  entry.submap = patch.submap;
  entry.vertices = static_cast<std::uint16_t>(patch.vertices.size());
  entry.triangles = static_cast<std::uint16_t>(patch.triangles.size());
  // The chain of free pages is cut off behind the last one taken.
  entry.first = first_free_;
  std::uint32_t last = kNone;
  const auto fill = [&](const auto* items, std::size_t count, std::size_t each) {
    for (std::size_t i = 0; i < count; i += each) {
      last = first_free_;
      first_free_ = next_[last];
      --free_pages_;
      std::memcpy(page_[last].bytes.data(), items + i, std::min(each, count - i) * sizeof(*items));
    }
  };
  fill(patch.vertices.data(), patch.vertices.size(), kPageVertices);
  fill(patch.triangles.data(), patch.triangles.size(), kPageTriangles);
  next_[last] = kNone;
}

bool SurfaceStore::read(std::uint32_t at, SurfacePatch& patch) const {
  const Entry& entry = entries_[at];
  if (entry.triangles == 0) return false;
  patch.block = entry.block;
  patch.submap = entry.submap;
  patch.vertices.resize(entry.vertices);
  patch.triangles.resize(entry.triangles);
  std::uint32_t page = entry.first;
  const auto take = [&](auto* items, std::size_t count, std::size_t each) {
    for (std::size_t i = 0; i < count; i += each) {
      std::memcpy(static_cast<void*>(items + i), page_[page].bytes.data(),
                  std::min(each, count - i) * sizeof(*items));
      page = next_[page];
    }
  };
  take(patch.vertices.data(), patch.vertices.size(), kPageVertices);
  take(patch.triangles.data(), patch.triangles.size(), kPageTriangles);
  return true;
}

void SurfaceStore::visit(SurfaceSink& sink, SurfacePatch& patch) {
  std::size_t count = 0;
  for (std::uint32_t i = 0; i < entries_.size(); ++i) {
    if (entries_[i].triangles > 0) far_[count++] = {0, keyOf(entries_[i].block), i};
  }
  std::sort(far_.begin(), far_.begin() + static_cast<std::ptrdiff_t>(count));
  for (std::size_t i = 0; i < count; ++i) {
    if (read(far_[i].entry, patch)) sink.take(patch);
  }
}

}  // namespace swiftlet
