// Real spherical harmonics up to degree 3, with the signs that trained files have. Twin: scene/harmonics.rs.

const float Y0 = 0.28209479177387814;
const float Y1 = 0.4886025119029199;
const float Y2[5] = float[](1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792, 0.5462742152960396);
const float Y3[7] = float[](-0.5900435899266435, 2.890611442640554, -0.4570457994644658, 0.3731763325901154, -0.4570457994644658, 1.445305721320277, -0.5900435899266435);

// The functions in unit direction `w`.
void harmonics(vec3 w, out float b[16]) {
    float x = w.x, y = w.y, z = w.z, xx = x * x, yy = y * y, zz = z * z;
    b[0] = Y0;
    b[1] = -Y1 * y;
    b[2] = Y1 * z;
    b[3] = -Y1 * x;
    b[4] = Y2[0] * x * y;
    b[5] = Y2[1] * y * z;
    b[6] = Y2[2] * (2.0 * zz - xx - yy);
    b[7] = Y2[3] * x * z;
    b[8] = Y2[4] * (xx - yy);
    b[9] = Y3[0] * y * (3.0 * xx - yy);
    b[10] = Y3[1] * x * y * z;
    b[11] = Y3[2] * y * (4.0 * zz - xx - yy);
    b[12] = Y3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
    b[13] = Y3[4] * x * (4.0 * zz - xx - yy);
    b[14] = Y3[5] * z * (xx - yy);
    b[15] = Y3[6] * x * (xx - 3.0 * yy);
}

// The gradient of function `k` by `w`, as a polynomial.
vec3 harmonic_gradient(uint k, vec3 w) {
    float x = w.x, y = w.y, z = w.z, xx = x * x, yy = y * y, zz = z * z;
    switch (k) {
        case 1: return vec3(0.0, -Y1, 0.0);
        case 2: return vec3(0.0, 0.0, Y1);
        case 3: return vec3(-Y1, 0.0, 0.0);
        case 4: return Y2[0] * vec3(y, x, 0.0);
        case 5: return Y2[1] * vec3(0.0, z, y);
        case 6: return Y2[2] * vec3(-2.0 * x, -2.0 * y, 4.0 * z);
        case 7: return Y2[3] * vec3(z, 0.0, x);
        case 8: return Y2[4] * vec3(2.0 * x, -2.0 * y, 0.0);
        case 9: return Y3[0] * vec3(6.0 * x * y, 3.0 * (xx - yy), 0.0);
        case 10: return Y3[1] * vec3(y * z, x * z, x * y);
        case 11: return Y3[2] * vec3(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z);
        case 12: return Y3[3] * vec3(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * (xx + yy));
        case 13: return Y3[4] * vec3(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z);
        case 14: return Y3[5] * vec3(2.0 * x * z, -2.0 * y * z, xx - yy);
        case 15: return Y3[6] * vec3(3.0 * (xx - yy), -6.0 * x * y, 0.0);
        default: return vec3(0.0);
    }
}
