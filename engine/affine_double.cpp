#include "engine/affine_double.h"

namespace shoal {

namespace {

Vec3d cross(const Vec3d& a, const Vec3d& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Vec3d& a, const Vec3d& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vec3 to_float(const Vec3d& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

Vec3d to_double(const Vec3& v) { return {v.x, v.y, v.z}; }

bool finite(const Vec3d& v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }

}  // namespace

AffineDouble affine_of(const std::array<double, 16>& matrix) {
  AffineDouble m;
  for (size_t i = 0; i < 3; ++i) m.column[i] = {matrix[4 * i], matrix[4 * i + 1], matrix[4 * i + 2]};
  m.translation = {matrix[12], matrix[13], matrix[14]};
  return m;
}

AffineDouble multiply(const AffineDouble& a, const AffineDouble& b) {
  AffineDouble r;
  for (int i = 0; i < 3; ++i) r.column[i] = a.vector(b.column[i]);
  r.translation = a.point(b.translation);
  return r;
}

double determinant(const AffineDouble& a) { return dot(a.column[0], cross(a.column[1], a.column[2])); }

AffineDouble cofactors(const AffineDouble& a) {
  AffineDouble r;
  for (int i = 0; i < 3; ++i) r.column[i] = cross(a.column[(i + 1) % 3], a.column[(i + 2) % 3]);
  return r;
}

AffineDouble inverse(const AffineDouble& a) {
  // The rows of the inverse are the cofactors' columns over the determinant.
  const AffineDouble c = cofactors(a);
  const double det = determinant(a);
  AffineDouble r;
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) r.column[col][row] = c.column[row][col] / det;
  }
  const Vec3d t = r.vector(a.translation);
  r.translation = {-t[0], -t[1], -t[2]};
  return r;
}

bool finite(const AffineDouble& a) {
  return finite(a.column[0]) && finite(a.column[1]) && finite(a.column[2]) && finite(a.translation);
}

double absolute_row_sum(const AffineDouble& a, const AffineDouble& b) {
  double largest = 0;
  for (int row = 0; row < 3; ++row) {
    double sum = 0;
    for (int col = 0; col < 3; ++col) {
      for (int k = 0; k < 3; ++k) sum += std::abs(a.column[k][row]) * std::abs(b.column[col][k]);
    }
    largest = std::max(largest, sum);
  }
  return largest;
}

Affine3 rounded(const AffineDouble& a) {
  return {to_float(a.column[0]), to_float(a.column[1]), to_float(a.column[2]), to_float(a.translation)};
}

AffineDouble widened(const Affine3& a) {
  return {{to_double(a.column_x), to_double(a.column_y), to_double(a.column_z)}, to_double(a.translation)};
}

Vec3d normalized_or_zero(const Vec3d& v) {
  const double largest = std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])});
  if (!(largest > 0) || !std::isfinite(largest)) return {0, 0, 0};
  // Scaled first: the square of the length can neither overflow nor vanish.
  const Vec3d s = {v[0] / largest, v[1] / largest, v[2] / largest};
  const double length = std::sqrt(dot(s, s));
  return {s[0] / length, s[1] / length, s[2] / length};
}

}  // namespace shoal
