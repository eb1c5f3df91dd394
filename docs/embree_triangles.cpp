// Traces the rays of `surfel bench` through a triangle mesh with Embree 4, so that both can be compared.
//
//   embree_triangles MESH.tri CAMERA.cam [--threads 1] [--runs 7] [--rays primary,shadow,bounce-any,bounce]
//                    [--width 1,16] [--quality low|medium|high] [--robust]
//
// MESH.tri holds little-endian numbers: the number of vertices and the number of triangles as u32, then x y z of
// each vertex as f32 and the three vertices of each triangle as u32. CAMERA.cam holds one line, the same as for
// `surfel bench --camera-file`. Rays are traced singly and in packets (--width: 1, 4, 8, 16), and for each kind of
// ray the fastest width counts.
//
// The program prints JSON with the names of `surfel bench --json`. Rays, their order and the formulas are those of
// surfel, in f32. Compile without fused multiply-add, so that the rays are equal to the last bit.
//
//   g++ -std=c++17 -O3 -march=native -ffp-contract=off embree_triangles.cpp -o embree_triangles -lembree4 -pthread
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <functional>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <sys/types.h>
#include <thread>
#include <vector>
#include <xmmintrin.h>

// The part of Embree's C interface that is used, declared here because Python wheels ship the library without
// headers.
extern "C" {
typedef struct RTCDeviceTy* RTCDevice;
typedef struct RTCSceneTy* RTCScene;
typedef struct RTCGeometryTy* RTCGeometry;
struct RTCIntersectArguments { int flags; unsigned features; void *context, *filter, *function; };
RTCDevice rtcNewDevice(const char* config);
ssize_t rtcGetDeviceProperty(RTCDevice, int property);
int rtcGetDeviceError(RTCDevice);
RTCScene rtcNewScene(RTCDevice);
void rtcSetSceneFlags(RTCScene, int flags);
void rtcSetSceneBuildQuality(RTCScene, int quality);
void rtcCommitScene(RTCScene);
void rtcReleaseScene(RTCScene);
RTCGeometry rtcNewGeometry(RTCDevice, int type);
void rtcSetSharedGeometryBuffer(RTCGeometry, int type, unsigned slot, int format, const void* data,
                                size_t offset, size_t stride, size_t count);
void rtcCommitGeometry(RTCGeometry);
unsigned rtcAttachGeometry(RTCScene, RTCGeometry);
void rtcReleaseGeometry(RTCGeometry);
void rtcIntersect1(RTCScene, void* ray_hit, RTCIntersectArguments*);
void rtcIntersect4(const int* valid, RTCScene, void* ray_hits, RTCIntersectArguments*);
void rtcIntersect8(const int* valid, RTCScene, void* ray_hits, RTCIntersectArguments*);
void rtcIntersect16(const int* valid, RTCScene, void* ray_hits, RTCIntersectArguments*);
void rtcOccluded1(RTCScene, void* ray, RTCIntersectArguments*);
void rtcOccluded4(const int* valid, RTCScene, void* rays, RTCIntersectArguments*);
void rtcOccluded8(const int* valid, RTCScene, void* rays, RTCIntersectArguments*);
void rtcOccluded16(const int* valid, RTCScene, void* rays, RTCIntersectArguments*);
}
const int VERSION = 0, TRIANGLES = 0, INDICES = 0, VERTICES = 1, UINT3 = 0x5003, FLOAT3 = 0x9003;
const int ROBUST = 1 << 2, COHERENT = 1 << 16;
const unsigned NOTHING = ~0u;

// ---- Vectors and rays

struct Vec { float x, y, z; };
Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec operator*(Vec a, float s) { return {a.x * s, a.y * s, a.z * s}; }
float dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
float length(Vec a) { return std::sqrt(dot(a, a)); }
Vec unit(Vec a) { return a * (1 / length(a)); }
Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

struct Ray { Vec origin; float t_min; Vec direction; float t_max; };
const Ray NO_RAY = {{0, 0, 0}, 0, {0, 0, 1}, -INFINITY};
const int MAX_WIDTH = 16, SIZE = 1024, TILE = 16;
const size_t CHUNK = 1024;

/// Rays padded to full packets, so that filling a packet is a loop of fixed length.
struct Rays {
    std::vector<Ray> padded;
    size_t count;
    explicit Rays(std::vector<Ray> rays) : padded(std::move(rays)), count(padded.size()) {
        padded.resize((count + MAX_WIDTH - 1) / MAX_WIDTH * MAX_WIDTH, NO_RAY);
    }
};

struct Nearest { float distance; unsigned id; };
struct Any { bool is_hit; };

// ---- Embree

/// K rays and hits in the layout of RTCRayHit, RTCRayHit4, RTCRayHit8 and RTCRayHit16.
template <int K> struct alignas(64) Packet {
    float origin[3][K], t_min[K], direction[3][K], time[K], t_max[K];
    unsigned mask[K], id[K], flags[K];
    float normal[3][K], u[K], v[K];
    unsigned primitive[K], geometry[K], instances[2][K];
};

template <int K>
void query(RTCScene scene, const int* valid, Packet<K>& packet, RTCIntersectArguments& how, Nearest) {
    if constexpr (K == 1) rtcIntersect1(scene, &packet, &how);
    if constexpr (K == 4) rtcIntersect4(valid, scene, &packet, &how);
    if constexpr (K == 8) rtcIntersect8(valid, scene, &packet, &how);
    if constexpr (K == 16) rtcIntersect16(valid, scene, &packet, &how);
}

template <int K>
void query(RTCScene scene, const int* valid, Packet<K>& packet, RTCIntersectArguments& how, Any) {
    if constexpr (K == 1) rtcOccluded1(scene, &packet, &how);
    if constexpr (K == 4) rtcOccluded4(valid, scene, &packet, &how);
    if constexpr (K == 8) rtcOccluded8(valid, scene, &packet, &how);
    if constexpr (K == 16) rtcOccluded16(valid, scene, &packet, &how);
}

template <int K> void keep(const Packet<K>& packet, int lane, Nearest& found) {
    found = {packet.t_max[lane], packet.geometry[lane] == NOTHING ? NOTHING : packet.primitive[lane]};
}

template <int K> void keep(const Packet<K>& packet, int lane, Any& found) {
    found.is_hit = packet.t_max[lane] < 0;
}

struct Setup { RTCScene scene; int width; bool is_coherent; };

/// Traces `n` rays, a multiple of K, and stores their hits.
template <int K, class Found>
void trace_chunk(const Setup& setup, const Ray* rays, size_t n, Found* found) {
    RTCIntersectArguments how = {setup.is_coherent ? COHERENT : 0, NOTHING, nullptr, nullptr, nullptr};
    Packet<K> packet = {};
    alignas(64) int valid[K];
    std::fill(packet.mask, packet.mask + K, ~0u);
    std::fill(valid, valid + K, -1);
    for (size_t first = 0; first < n; first += K) {
        for (int lane = 0; lane < K; lane++) {
            const Ray& ray = rays[first + lane];
            packet.origin[0][lane] = ray.origin.x;
            packet.origin[1][lane] = ray.origin.y;
            packet.origin[2][lane] = ray.origin.z;
            packet.t_min[lane] = ray.t_min;
            packet.direction[0][lane] = ray.direction.x;
            packet.direction[1][lane] = ray.direction.y;
            packet.direction[2][lane] = ray.direction.z;
            packet.t_max[lane] = ray.t_max;
            packet.geometry[lane] = NOTHING;
        }
        query<K>(setup.scene, valid, packet, how, Found());
        for (int lane = 0; lane < K; lane++) keep<K>(packet, lane, found[first + lane]);
    }
}

/// Traces all rays: each thread claims chunks until none is left.
template <class Found>
void trace(const Setup& setup, int n_threads, const Rays& rays, std::vector<Found>& found) {
    const auto chunk = setup.width == 1   ? trace_chunk<1, Found>
                       : setup.width == 4 ? trace_chunk<4, Found>
                       : setup.width == 8 ? trace_chunk<8, Found>
                                          : trace_chunk<16, Found>;
    std::atomic<size_t> next{0};
    const auto work = [&] {
        _mm_setcsr(_mm_getcsr() | 0x8040); // Denormals are zero, as Embree advises.
        const size_t n_rays = rays.padded.size();
        for (size_t first; (first = next.fetch_add(CHUNK)) < n_rays;)
            chunk(setup, &rays.padded[first], std::min(CHUNK, n_rays - first), &found[first]);
    };
    std::vector<std::thread> others;
    for (int i = 1; i < n_threads; i++) others.emplace_back(work);
    work();
    for (std::thread& other : others) other.join();
}

// ---- Time

/// Seconds of processor time, summed over all threads, and of wall time.
struct Elapsed { double cpu, wall; };

Elapsed now() {
    timespec cpu;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &cpu);
    const auto wall = std::chrono::steady_clock::now().time_since_epoch();
    return {cpu.tv_sec + 1e-9 * cpu.tv_nsec, std::chrono::duration<double>(wall).count()};
}

Elapsed timed(const std::function<void()>& work) {
    const Elapsed start = now();
    work();
    const Elapsed end = now();
    return {end.cpu - start.cpu, end.wall - start.wall};
}

// ---- Mesh

struct Mesh {
    std::vector<Vec> vertices; // One more than the mesh has: Embree reads 16 bytes of the last.
    std::vector<std::array<uint32_t, 3>> triangles;
    std::array<Vec, 3> corners(unsigned id) const {
        const auto& [a, b, c] = triangles[id];
        return {vertices[a], vertices[b], vertices[c]};
    }
};

Mesh read_mesh(const std::string& path) {
    FILE* file = std::fopen(path.c_str(), "rb");
    if (!file) throw std::runtime_error(path + ": cannot be opened");
    const auto read = [&](void* data, size_t size, size_t count) {
        const bool is_whole = std::fread(data, size, count, file) == count;
        if (!is_whole) throw std::runtime_error(path + ": the file is truncated");
    };
    uint32_t counts[2];
    read(counts, sizeof counts, 1);
    Mesh mesh;
    mesh.vertices.resize(size_t(counts[0]) + 1);
    mesh.triangles.resize(counts[1]);
    read(mesh.vertices.data(), sizeof(Vec), counts[0]);
    read(mesh.triangles.data(), sizeof mesh.triangles[0], counts[1]);
    std::fclose(file);
    for (const auto& triangle : mesh.triangles)
        for (const uint32_t vertex : triangle)
            if (vertex >= counts[0]) throw std::runtime_error(path + ": a triangle has a vertex that does not exist");
    return mesh;
}

RTCScene build(RTCDevice device, const Mesh& mesh, int quality, bool is_robust) {
    const RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, is_robust ? ROBUST : 0);
    rtcSetSceneBuildQuality(scene, quality);
    const RTCGeometry geometry = rtcNewGeometry(device, TRIANGLES);
    const size_t n_vertices = mesh.vertices.size() - 1, n_triangles = mesh.triangles.size();
    rtcSetSharedGeometryBuffer(geometry, VERTICES, 0, FLOAT3, mesh.vertices.data(), 0, 12, n_vertices);
    rtcSetSharedGeometryBuffer(geometry, INDICES, 0, UINT3, mesh.triangles.data(), 0, 12, n_triangles);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
    const int error = rtcGetDeviceError(device);
    if (error) throw std::runtime_error("Embree reports error " + std::to_string(error));
    return scene;
}

// ---- Kinds of rays

struct Camera { Vec eye, target; float view_angle_deg; Vec light; };

Camera read_camera(const std::string& path) {
    FILE* file = std::fopen(path.c_str(), "r");
    if (!file) throw std::runtime_error(path + ": cannot be opened");
    double n[10];
    for (double& number : n)
        if (std::fscanf(file, "%lf ,", &number) != 1) throw std::runtime_error(path + ": expected ten numbers");
    std::fclose(file);
    const auto vec = [&](int i) { return Vec{float(n[i]), float(n[i + 1]), float(n[i + 2])}; };
    return {vec(0), vec(3), float(n[6]), vec(7)};
}

/// Returns bits 0, 2, 4 and 6 next to each other: one coordinate of a Morton code.
int even_bits(int code) { return (code & 1) | (code >> 1 & 2) | (code >> 2 & 4) | (code >> 3 & 8); }

/// Returns rays through the centres of all pixels: tiles row by row, in Morton order inside a tile.
Rays camera_rays(const Camera& camera) {
    const float pi = 3.14159265f, size = SIZE;
    const Vec forward = unit(camera.target - camera.eye);
    const Vec right = unit(cross(forward, {0, 0, 1})), up = cross(right, forward);
    const float half_height = std::tan(camera.view_angle_deg / 2 * (pi / 180));
    std::vector<Ray> rays;
    for (int tile = 0; tile < SIZE / TILE * (SIZE / TILE); tile++) {
        for (int code = 0; code < TILE * TILE; code++) {
            const float x = float(tile % (SIZE / TILE) * TILE + even_bits(code));
            const float y = float(tile / (SIZE / TILE) * TILE + even_bits(code >> 1));
            const float across = (2 * (x + 0.5f) / size - 1) * half_height * size / size;
            const float along = (1 - 2 * (y + 0.5f) / size) * half_height;
            rays.push_back({camera.eye, 0, unit(forward + right * across + up * along), INFINITY});
        }
    }
    return Rays(rays);
}

/// Returns a number in [0, 1) and advances the state by Wellons' `lowbias32` (2018).
float random_number(uint32_t& state) {
    uint32_t x = state + 0x9e3779b9;
    x = (x ^ x >> 16) * 0x7feb352d;
    x = (x ^ x >> 15) * 0x846ca68b;
    state = x ^ x >> 16;
    return float(state >> 8) / (1 << 24);
}

Vec cosine_direction(Vec normal, uint32_t seed) {
    uint32_t state = seed * 2654435761;
    const float height = random_number(state), turn = 6.28318530717958647f * random_number(state);
    const Vec tangent = unit(cross(normal, std::fabs(normal.x) > 0.5f ? Vec{0, 1, 0} : Vec{1, 0, 0}));
    const Vec bitangent = cross(normal, tangent);
    const float across = std::sqrt(height) * std::cos(turn), along = std::sqrt(height) * std::sin(turn);
    return unit(tangent * across + bitangent * along + normal * std::sqrt(std::max(1 - height, 0.0f)));
}

/// A point just off a hit surface, on the side that the ray came from; `seed` is the index of that ray.
struct Start { Vec origin, normal; uint32_t seed; };

std::vector<Start> starts(const Mesh& mesh, const Rays& rays, const std::vector<Nearest>& hits) {
    std::vector<Start> starts;
    for (size_t i = 0; i < rays.count; i++) {
        if (hits[i].id == NOTHING) continue;
        const Ray& ray = rays.padded[i];
        const auto [a, b, c] = mesh.corners(hits[i].id);
        Vec normal = unit(cross(b - a, c - a));
        if (dot(normal, ray.direction) > 0) normal = normal * -1;
        const float offset = 1e-4f * length(a - b);
        starts.push_back({ray.origin + ray.direction * hits[i].distance + normal * offset, normal, uint32_t(i)});
    }
    return starts;
}

Rays shadow_rays(const std::vector<Start>& starts, Vec light) {
    std::vector<Ray> rays;
    for (const Start& start : starts) {
        const Vec toward = light - start.origin;
        rays.push_back({start.origin, 0, unit(toward), length(toward)});
    }
    return Rays(rays);
}

Rays bounce_rays(const std::vector<Start>& starts) {
    std::vector<Ray> rays;
    for (const Start& start : starts)
        rays.push_back({start.origin, 0, cosine_direction(start.normal, start.seed), INFINITY});
    return Rays(rays);
}

// ---- Measuring

struct Options {
    int n_threads = 1, n_runs = 7, quality = 1;
    bool is_robust = false;
    std::vector<std::string> kinds = {"primary", "shadow", "bounce-any", "bounce"};
    std::vector<int> widths = {1, 16};
};

struct Times { int width; double median, best, best_wall; };

/// Measures each width: one untimed run, which touches all memory, then `n_runs` timed ones. Returns the times of
/// the width with the best median.
template <class Found>
Times measure(const Options& options, Setup setup, const Rays& rays, std::vector<Found>& found) {
    Times fastest = {0, INFINITY, INFINITY, INFINITY};
    found.assign(rays.padded.size(), Found());
    for (const int width : options.widths) {
        setup.width = width;
        const auto work = [&] { trace(setup, options.n_threads, rays, found); };
        work();
        std::vector<double> cpu;
        double best_wall = INFINITY;
        for (int run = 0; run < options.n_runs; run++) {
            const Elapsed elapsed = timed(work);
            cpu.push_back(elapsed.cpu / options.n_threads);
            best_wall = std::min(best_wall, elapsed.wall);
        }
        std::sort(cpu.begin(), cpu.end());
        const double median = cpu[cpu.size() / 2];
        if (median < fastest.median) fastest = {width, median, cpu[0], best_wall};
    }
    return fastest;
}

std::string json(const char* format, double number) {
    char text[64];
    std::snprintf(text, sizeof text, format, number);
    return std::isfinite(number) ? text : "null";
}

std::string json(const Times& times, size_t n_rays, size_t n_hits) {
    const auto speed = [&](double secs) { return json("%.4f", 1e-6 * n_rays / secs); };
    return "\"rays\": " + std::to_string(n_rays) + ", \"hits\": " + std::to_string(n_hits) +
           ", \"median_mrays_per_s\": " + speed(times.median) + ", \"best_mrays_per_s\": " + speed(times.best) +
           ", \"wall_mrays_per_s\": " + speed(times.best_wall) + ", \"width\": " + std::to_string(times.width);
}

std::string measure_nearest(const Options& options, Setup setup, const Rays& rays) {
    std::vector<Nearest> found;
    const Times times = measure(options, setup, rays, found);
    size_t n_hits = 0;
    double sum = 0;
    for (size_t i = 0; i < rays.count; i++) {
        if (found[i].id == NOTHING) continue;
        n_hits++;
        sum += found[i].distance;
    }
    return json(times, rays.count, n_hits) + ", \"mean_distance\": " + json("%.9g", sum / n_hits);
}

std::string measure_any(const Options& options, Setup setup, const Rays& rays) {
    std::vector<Any> found;
    const Times times = measure(options, setup, rays, found);
    const auto is_hit = [](Any any) { return any.is_hit; };
    return json(times, rays.count, std::count_if(found.begin(), found.begin() + rays.count, is_hit));
}

std::vector<std::string> split_list(const std::string& list) {
    std::vector<std::string> words;
    std::istringstream stream(list);
    for (std::string word; std::getline(stream, word, ',');) words.push_back(word);
    return words;
}

/// Returns the value of a name, or throws if the name is unknown.
template <class Value> Value choose(const std::map<std::string, Value>& known, const std::string& name) {
    const auto found = known.find(name);
    if (found == known.end()) throw std::runtime_error("`" + name + "` is unknown");
    return found->second;
}

Options parse(const std::vector<std::string>& args) {
    const std::map<std::string, int> qualities = {{"low", 0}, {"medium", 1}, {"high", 2}};
    const std::map<std::string, int> widths = {{"1", 1}, {"4", 4}, {"8", 8}, {"16", 16}};
    Options options;
    for (size_t i = 2; i < args.size(); i++) {
        const std::string& name = args[i];
        if (name == "--robust") { options.is_robust = true; continue; }
        if (i + 1 == args.size()) throw std::runtime_error(name + ": unknown option, or its value is missing");
        const std::string& value = args[++i];
        if (name == "--threads") options.n_threads = std::max(1, std::stoi(value));
        else if (name == "--runs") options.n_runs = std::max(1, std::stoi(value));
        else if (name == "--rays") options.kinds = split_list(value);
        else if (name == "--quality") options.quality = choose(qualities, value);
        else if (name == "--width") {
            options.widths.clear();
            for (const std::string& word : split_list(value)) options.widths.push_back(choose(widths, word));
        } else throw std::runtime_error(name + ": unknown option");
    }
    return options;
}

void run(const std::vector<std::string>& args) {
    const Options options = parse(args);
    const Mesh mesh = read_mesh(args[0]);
    const Camera camera = read_camera(args[1]);
    const RTCDevice device = rtcNewDevice(("threads=" + std::to_string(options.n_threads)).c_str());

    RTCScene scene = nullptr;
    Elapsed least = {INFINITY, INFINITY};
    const size_t n_vertices = mesh.vertices.size() - 1;
    const int n_builds = n_vertices <= 2'000'000 ? 5 : n_vertices <= 20'000'000 ? 2 : 1;
    for (int i = 0; i < n_builds; i++) {
        if (scene) rtcReleaseScene(scene);
        const Elapsed elapsed = timed([&] { scene = build(device, mesh, options.quality, options.is_robust); });
        least = {std::min(least.cpu, elapsed.cpu), std::min(least.wall, elapsed.wall)};
    }

    const Rays primary = camera_rays(camera);
    std::vector<Nearest> hits(primary.padded.size());
    trace({scene, MAX_WIDTH, true}, options.n_threads, primary, hits);
    const std::vector<Start> starts = ::starts(mesh, primary, hits);

    std::string rays;
    for (const std::string& kind : options.kinds) {
        const Setup coherent = {scene, 0, true}, incoherent = {scene, 0, false};
        std::string row;
        if (kind == "primary") row = measure_nearest(options, coherent, primary);
        else if (kind == "shadow") row = measure_any(options, coherent, shadow_rays(starts, camera.light));
        else if (kind == "bounce-any") row = measure_any(options, incoherent, bounce_rays(starts));
        else if (kind == "bounce") row = measure_nearest(options, incoherent, bounce_rays(starts));
        else throw std::runtime_error(kind + ": unknown kind of rays");
        rays += (rays.empty() ? "\n    \"" : ",\n    \"") + kind + "\": {" + row + "}";
    }
    std::printf("{\n  \"rays\": {%s\n  },\n  \"build_s\": %.6f,\n  \"build_cpu_s\": %.6f,\n  \"threads\": %d,\n"
                "  \"triangles\": %zu,\n  \"quality\": %d,\n  \"robust\": %s,\n  \"embree\": %zd\n}\n",
                rays.c_str(), least.wall, least.cpu, options.n_threads, mesh.triangles.size(), options.quality,
                options.is_robust ? "true" : "false", rtcGetDeviceProperty(device, VERSION));
}

int main(int n_args, char** args) {
    if (n_args < 3) {
        std::fprintf(stderr, "embree_triangles MESH.tri CAMERA.cam [options]; see the beginning of its source\n");
        return 2;
    }
    try {
        run({args + 1, args + n_args});
    } catch (const std::exception& error) {
        std::fprintf(stderr, "embree_triangles: %s\n", error.what());
        return 1;
    }
}
