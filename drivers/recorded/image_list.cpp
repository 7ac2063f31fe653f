#include "drivers/recorded/image_list.hpp"

#include "drivers/recorded/order_by_stamp.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

std::vector<ImageRow> readImageRows(CsvReader& csv, LogCounters& counters, LogWarnings& warnings) {
  std::vector<ImageRow> rows;
  while (csv.next(1)) {
    ImageRow row;
    if (!parseCsvStamp(csv.field(0), row.stamp)) {
      csv.reject("timestamp", quoteInput(csv.field(0)) + " is not a stamp in ns");
      continue;
    }
    row.file = csv.field(1);
    rows.push_back(std::move(row));
  }
  csv.finish("images", "Write each row as: stamp [ns], file name");
  orderByStamp(rows, csv.name(), counters, warnings);
  return rows;
}

}  // namespace

std::vector<ImageRow> readImageList(const std::string& path, LogCounters& counters, LogWarnings& warnings) {
  CsvReader csv(path, CsvReader::Separator::kComma, counters, warnings);
  return readImageRows(csv, counters, warnings);
}

std::vector<ImageRow> readImageListText(const std::string& name, std::string_view text, LogCounters& counters,
                                        LogWarnings& warnings) {
  CsvReader csv(name, text, CsvReader::Separator::kComma, counters, warnings);
  return readImageRows(csv, counters, warnings);
}

}  // namespace swiftlet
