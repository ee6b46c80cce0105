// What an instance contributes to its Gaussian: sums over pixels.
// Red, green, blue; then with q = dL/da * a and d from the mean to the pixel: the sums of q, q dx, q dy, q dx^2, q dx dy, q dy^2.
const uint SUMS = 9;
