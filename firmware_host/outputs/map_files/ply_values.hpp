#pragma once
// Reads the numbers after a PLY header one by one, in any encoding.

#include <string>
#include <string_view>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/map_files/ply_header.hpp"

namespace swiftlet {

class PlyValues {
 public:
  /// `name`, `bytes` and `header` must outlive the reader.
  PlyValues(const std::string& name, std::string_view bytes, const PlyHeader& header);

  /// Call before and after every row. In ASCII a row is a line; blank lines are skipped.
  void beginRow(const PlyElement& element, std::uint64_t index);
  void endRow();
  /// The next number of the row; refused if `type` cannot hold it. NaN and infinity are accepted here.
  double next(PlyType type, std::string_view property);
  /// A list's length.
  std::uint64_t nextLength(PlyType type, std::string_view property);
  /// After all rows: only blanks may follow.
  void finish();

  /// Error that names the row's line or the last value's byte.
  [[nodiscard]] InputError error(std::string_view property, const std::string& message,
                                 const std::string& remedy) const;

 private:
  std::string_view takeWord();
  double nextText(PlyType type, std::string_view property);
  double nextBinary(PlyType type, std::string_view property);

  const std::string& name_;
  std::string_view bytes_;
  bool binary_;
  std::size_t at_ = 0;    ///< position of the next byte
  std::size_t from_ = 0;  ///< position of the last value
  int line_ = 0;
  std::string_view row_;  ///< rest of the line
  const PlyElement* element_ = nullptr;
  std::uint64_t index_ = 0;
};

}  // namespace swiftlet
