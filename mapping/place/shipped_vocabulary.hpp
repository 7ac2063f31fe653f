#pragma once
// The bytes of mapping/place/vocabulary.swv, which the build embeds in the library.

#include <cstdint>
#include <span>

namespace swiftlet {

std::span<const std::uint8_t> shippedVocabularyBytes();

}  // namespace swiftlet
