#pragma once
// An MCAP file: chunks without packing, with LZ4 or zstd, messages outside of chunks, indexed or not,
// finished or not. Layout: drivers/bag/mcap_records.hpp.
//
// Opening walks over the records; chunks with a message index are not unpacked. Checksums of chunks are
// compared when they are read, that of the summary when the file is opened, that of the data only where
// messages lie outside of chunks.

#include <memory>
#include <string>

#include "drivers/bag/bag_file.hpp"

namespace swiftlet {

/// `name` names the file in messages.
[[nodiscard]] std::unique_ptr<BagFile> openMcapFile(const std::string& path, const std::string& name);

}  // namespace swiftlet
