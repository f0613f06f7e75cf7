#include "io/content_hash.h"

#include <xxhash.h>

#include "io/result.h"

namespace shoal {

struct ContentHash::State {
  XXH3_state_t* state = XXH3_createState();  // by the library: it has to be aligned
  ~State() { XXH3_freeState(state); }
};

ContentHash::ContentHash() : state_(std::make_unique<State>()) {
  SHOAL_CHECK(state_->state != nullptr);
  XXH3_64bits_reset(state_->state);
}

ContentHash::~ContentHash() = default;

void ContentHash::add(std::span<const std::byte> bytes) {
  XXH3_64bits_update(state_->state, bytes.data(), bytes.size());
}

void ContentHash::add_text(std::string_view text) {
  add_number(text.size());
  add(std::as_bytes(std::span(text)));
}

void ContentHash::add_number(uint64_t number) { add(std::as_bytes(std::span(&number, 1))); }

uint64_t ContentHash::value() const { return XXH3_64bits_digest(state_->state); }

}  // namespace shoal
