// Reference client of Lumbre's protocol for servers, version 1: docs/reference/external.md.
// Arguments: width and height of the pictures. This one "renders" uniform noise around 0.5; replace
// `render`, and load the scene before the line `ready`. Print nothing else to standard output.
#include <chrono>
#include <fstream>
#include <iostream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

// Returns linear radiance: three numbers for each pixel, the last row first.
static std::vector<float> render(int width, int height, long spp, unsigned seed) {
    std::mt19937 rng(seed);
    std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
    std::vector<float> values(3 * size_t(width) * height, 0.0f);
    for (float &value : values)
        for (long sample = 0; sample < spp; ++sample) value += uniform(rng) / spp;
    return values;
}

int main(int, char **argv) {
    const int width = std::stoi(argv[1]), height = std::stoi(argv[2]);
    std::cout << "ready 1 cpu, 1 threads, noise 1.0" << std::endl;
    for (std::string line; std::getline(std::cin, line);) {
        std::istringstream request(line);
        long spp;
        unsigned seed;
        std::string file;
        std::getline(request >> spp >> seed >> std::ws, file);
        const auto start = std::chrono::steady_clock::now();
        const std::vector<float> values = render(width, height, spp, seed);
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
        std::ofstream picture(file, std::ios::binary);
        picture << "PF\n" << width << " " << height << "\n-1.0\n";
        picture.write(reinterpret_cast<const char *>(values.data()), 4 * values.size());
        picture.close();
        std::cout << (picture ? std::to_string(seconds.count()) : "failed cannot write the file") << std::endl;
    }
}
