// Numbers without rounding: an integer times a power of two, with sums, differences and products. For oracles of tests:
// whatever floats are, the sign of a determinant of them is right. Every float and every double is such a number.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>

namespace shoal::testing {

class Exact {
 public:
  Exact() = default;
  /// Requires: finite.
  Exact(double value) {  // NOLINT: a double is one
    if (value == 0) return;
    const double fraction = std::frexp(std::abs(value), &exponent_);
    limbs_[0] = static_cast<uint64_t>(std::ldexp(fraction, 53));
    exponent_ -= 53;
    size_ = 1;
    negative_ = value < 0;
    drop_zeros();
  }
  Exact(const Exact& other) { *this = other; }
  Exact& operator=(const Exact& other) {
    negative_ = other.negative_, exponent_ = other.exponent_, size_ = other.size_;
    std::copy_n(other.limbs_.begin(), size_, limbs_.begin());
    return *this;
  }

  int sign() const { return size_ == 0 ? 0 : negative_ ? -1 : 1; }
  /// Within one part in 2^52; zero or infinity where a double has no such number.
  double to_double() const {
    double sum = 0;
    for (size_t i = size_, left = 3; i > 0 && left > 0; --i, --left) {
      sum += std::ldexp(static_cast<double>(limbs_[i - 1]), exponent_ + 64 * static_cast<int>(i - 1));
    }
    return negative_ ? -sum : sum;
  }

  friend Exact operator-(Exact a) {
    a.negative_ = !a.negative_;
    return a;
  }
  friend Exact operator+(const Exact& a, const Exact& b) {
    if (a.size_ == 0) return b;
    if (b.size_ == 0) return a;
    const int exponent = std::min(a.exponent_, b.exponent_);
    const Exact x = a.shifted_to(exponent), y = b.shifted_to(exponent);
    if (x.negative_ == y.negative_) return add_sizes(x, y);
    return compare_sizes(x, y) >= 0 ? subtract_sizes(x, y) : subtract_sizes(y, x);
  }
  friend Exact operator-(const Exact& a, const Exact& b) { return a + -b; }
  friend Exact operator*(const Exact& a, const Exact& b) {
    Exact product;
    if (a.size_ == 0 || b.size_ == 0) return product;
    product.grow_to(a.size_ + b.size_);
    product.negative_ = a.negative_ != b.negative_;
    product.exponent_ = a.exponent_ + b.exponent_;
    for (size_t i = 0; i < a.size_; ++i) {
      uint64_t carry = 0;
      for (size_t j = 0; j < b.size_; ++j) {
        const Wide sum = Wide{a.limbs_[i]} * b.limbs_[j] + product.limbs_[i + j] + carry;
        product.limbs_[i + j] = static_cast<uint64_t>(sum);
        carry = static_cast<uint64_t>(sum >> 64);
      }
      product.limbs_[i + b.size_] = carry;
    }
    product.drop_zeros();
    return product;
  }
  friend int compare(const Exact& a, const Exact& b) { return (a - b).sign(); }

 private:
  using Wide = unsigned __int128;
  /// 2304 bits: a product of two determinants of differences of any floats takes 1700.
  static constexpr size_t kLimbs = 36;

  void grow_to(size_t size) {
    if (size > kLimbs) std::abort();  // a test that needs more than its arithmetic has
    std::fill(limbs_.begin() + static_cast<long>(size_), limbs_.begin() + static_cast<long>(size), 0);
    size_ = size;
  }
  /// Of the highest limbs, and whole limbs of zeros below.
  void drop_zeros() {
    while (size_ > 0 && limbs_[size_ - 1] == 0) --size_;
    size_t low = 0;
    while (low < size_ && limbs_[low] == 0) ++low;
    if (low == 0) return;
    std::copy(limbs_.begin() + static_cast<long>(low), limbs_.begin() + static_cast<long>(size_), limbs_.begin());
    size_ -= low;
    exponent_ = size_ == 0 ? 0 : exponent_ + 64 * static_cast<int>(low);
  }
  Exact shifted_to(int exponent) const {
    const auto by = static_cast<size_t>(exponent_ - exponent);
    if (by == 0) return *this;
    Exact shifted;
    shifted.negative_ = negative_, shifted.exponent_ = exponent;
    shifted.grow_to(size_ + by / 64 + 1);
    for (size_t i = 0; i < size_; ++i) {
      const Wide wide = Wide{limbs_[i]} << (by % 64);
      shifted.limbs_[i + by / 64] |= static_cast<uint64_t>(wide);
      shifted.limbs_[i + by / 64 + 1] |= static_cast<uint64_t>(wide >> 64);
    }
    while (shifted.size_ > 0 && shifted.limbs_[shifted.size_ - 1] == 0) --shifted.size_;
    return shifted;
  }
  static int compare_sizes(const Exact& x, const Exact& y) {
    if (x.size_ != y.size_) return x.size_ < y.size_ ? -1 : 1;
    for (size_t i = x.size_; i > 0; --i) {
      if (x.limbs_[i - 1] != y.limbs_[i - 1]) return x.limbs_[i - 1] < y.limbs_[i - 1] ? -1 : 1;
    }
    return 0;
  }
  static Exact add_sizes(const Exact& x, const Exact& y) {
    Exact sum = x.size_ >= y.size_ ? x : y;
    const Exact& other = x.size_ >= y.size_ ? y : x;
    sum.grow_to(sum.size_ + 1);
    uint64_t carry = 0;
    for (size_t i = 0; i < sum.size_; ++i) {
      const Wide wide = Wide{sum.limbs_[i]} + (i < other.size_ ? other.limbs_[i] : 0) + carry;
      sum.limbs_[i] = static_cast<uint64_t>(wide);
      carry = static_cast<uint64_t>(wide >> 64);
    }
    sum.drop_zeros();
    return sum;
  }
  /// Requires: x is not smaller.
  static Exact subtract_sizes(const Exact& x, const Exact& y) {
    Exact difference = x;
    uint64_t borrow = 0;
    for (size_t i = 0; i < x.size_; ++i) {
      const uint64_t take = i < y.size_ ? y.limbs_[i] : 0, from = x.limbs_[i];
      difference.limbs_[i] = from - take - borrow;
      borrow = from < take || (from == take && borrow != 0) ? 1 : 0;
    }
    difference.drop_zeros();
    return difference;
  }

  bool negative_ = false;
  int exponent_ = 0;  ///< of the lowest bit of limbs_[0]
  size_t size_ = 0;
  std::array<uint64_t, kLimbs> limbs_{};
};

}  // namespace shoal::testing
