@ The 16-bit map for Cortex-M4 with 25 inputs; arithmetic as src/quantized/mod.rs says, layout as docs/weights-image.md.
@
@ void hae_m4f_i16(const uint32_t *tiles, const float *q, float *y, int64_t *sums, const float *tail, size_t outputs)
@
@   tiles   up to tail, tiles of 6 hidden units: 6 words of b1, 13 pairs of inputs x 6 words, outputs x 3 words
@   tail    26 input scales, then outputs factors, then outputs biases
@   sums    room for one 64-bit sum an output
@
@ r0 runs through the tiles. In a tile: r1-r6 the hidden units, r7 and r8 two pairs of inputs, r9-r12 and lr five words of
@ weights. The 13 pairs of inputs stay in s0-s12; s13 the factors' address, s14 the tiles' end, s15 the outputs.

        .syntax unified
        .thumb
        .fpu    fpv4-sp-d16

        .equ    .Lhae_i_SUMS, 52        @ the frame: 13 words of inputs on their way to s0-s12, then these
        .equ    .Lhae_i_Y, 56
        .equ    .Lhae_i_FRAME, 64
        .equ    .Lhae_i_ARGUMENTS, .Lhae_i_FRAME + 9*4

        .section .text.hae_m4f_i16, "ax", %progbits
        .global hae_m4f_i16
        .type   hae_m4f_i16, %function
        .p2align 2
        .thumb_func
hae_m4f_i16:
        push    {r4-r11, lr}
        sub     sp, #.Lhae_i_FRAME
        ldrd    r4, r5, [sp, #.Lhae_i_ARGUMENTS]
        str     r3, [sp, #.Lhae_i_SUMS]
        str     r2, [sp, #.Lhae_i_Y]
        vmov    s14, r4
        vmov    s15, r5

        @ inputs to integers, two in a word; VCVTR rounds as FPSCR says, to nearest even
        mov     r6, sp
        movs    r7, #12
1:      vldmia  r1!, {s0-s1}
        vldmia  r4!, {s2-s3}
        vmul.f32 s0, s0, s2
        vmul.f32 s1, s1, s3
        vcvtr.s32.f32 s0, s0
        vcvtr.s32.f32 s1, s1
        vmov    r8, r9, s0, s1
        ssat    r8, #16, r8
        ssat    r9, #16, r9
        pkhbt   r8, r8, r9, lsl #16
        str     r8, [r6], #4
        subs    r7, #1
        bne     1b
        vldr    s0, [r1]                @ the 25th alone
        vldmia  r4!, {s2-s3}
        vmul.f32 s0, s0, s2
        vcvtr.s32.f32 s0, s0
        vmov    r8, s0
        ssat    r8, #16, r8
        uxth    r8, r8
        str     r8, [r6]
        vldmia  sp, {s0-s12}
        vmov    s13, r4

        movs    r8, #0                  @ sums = 0
        movs    r9, #0
2:      strd    r8, r9, [r3], #8
        subs    r5, #1
        bne     2b

3:      @ a tile: the hidden units
        ldmia   r0!, {r1-r6}
        ldmia   r0!, {r9-r12, lr}
        vmov    r7, r8, s0, s1
        smlad   r1, r9, r7, r1
        smlad   r2, r10, r7, r2
        smlad   r3, r11, r7, r3
        smlad   r4, r12, r7, r4
        smlad   r5, lr, r7, r5
        ldmia   r0!, {r9-r12, lr}
        smlad   r6, r9, r7, r6
        smlad   r1, r10, r8, r1
        smlad   r2, r11, r8, r2
        smlad   r3, r12, r8, r3
        smlad   r4, lr, r8, r4
        ldmia   r0!, {r9-r12, lr}
        smlad   r5, r9, r8, r5
        smlad   r6, r10, r8, r6
        vmov    r7, r8, s2, s3
        smlad   r1, r11, r7, r1
        smlad   r2, r12, r7, r2
        smlad   r3, lr, r7, r3
        ldmia   r0!, {r9-r12, lr}
        smlad   r4, r9, r7, r4
        smlad   r5, r10, r7, r5
        smlad   r6, r11, r7, r6
        smlad   r1, r12, r8, r1
        smlad   r2, lr, r8, r2
        ldmia   r0!, {r9-r12, lr}
        smlad   r3, r9, r8, r3
        smlad   r4, r10, r8, r4
        smlad   r5, r11, r8, r5
        smlad   r6, r12, r8, r6
        vmov    r7, r8, s4, s5
        smlad   r1, lr, r7, r1
        ldmia   r0!, {r9-r12, lr}
        smlad   r2, r9, r7, r2
        smlad   r3, r10, r7, r3
        smlad   r4, r11, r7, r4
        smlad   r5, r12, r7, r5
        smlad   r6, lr, r7, r6
        ldmia   r0!, {r9-r12, lr}
        smlad   r1, r9, r8, r1
        smlad   r2, r10, r8, r2
        smlad   r3, r11, r8, r3
        smlad   r4, r12, r8, r4
        smlad   r5, lr, r8, r5
        ldmia   r0!, {r9-r12, lr}
        smlad   r6, r9, r8, r6
        vmov    r7, r8, s6, s7
        smlad   r1, r10, r7, r1
        smlad   r2, r11, r7, r2
        smlad   r3, r12, r7, r3
        smlad   r4, lr, r7, r4
        ldmia   r0!, {r9-r12, lr}
        smlad   r5, r9, r7, r5
        smlad   r6, r10, r7, r6
        smlad   r1, r11, r8, r1
        smlad   r2, r12, r8, r2
        smlad   r3, lr, r8, r3
        ldmia   r0!, {r9-r12, lr}
        smlad   r4, r9, r8, r4
        smlad   r5, r10, r8, r5
        smlad   r6, r11, r8, r6
        vmov    r7, r8, s8, s9
        smlad   r1, r12, r7, r1
        smlad   r2, lr, r7, r2
        ldmia   r0!, {r9-r12, lr}
        smlad   r3, r9, r7, r3
        smlad   r4, r10, r7, r4
        smlad   r5, r11, r7, r5
        smlad   r6, r12, r7, r6
        smlad   r1, lr, r8, r1
        ldmia   r0!, {r9-r12, lr}
        smlad   r2, r9, r8, r2
        smlad   r3, r10, r8, r3
        smlad   r4, r11, r8, r4
        smlad   r5, r12, r8, r5
        smlad   r6, lr, r8, r6
        ldmia   r0!, {r9-r12, lr}
        vmov    r7, r8, s10, s11
        smlad   r1, r9, r7, r1
        smlad   r2, r10, r7, r2
        smlad   r3, r11, r7, r3
        smlad   r4, r12, r7, r4
        smlad   r5, lr, r7, r5
        ldmia   r0!, {r9-r12, lr}
        smlad   r6, r9, r7, r6
        smlad   r1, r10, r8, r1
        smlad   r2, r11, r8, r2
        smlad   r3, r12, r8, r3
        smlad   r4, lr, r8, r4
        ldmia   r0!, {r9-r12, lr}
        smlad   r5, r9, r8, r5
        smlad   r6, r10, r8, r6
        vmov    r7, s12
        smlad   r1, r11, r7, r1
        smlad   r2, r12, r7, r2
        smlad   r3, lr, r7, r3
        ldmia   r0!, {r9-r11}
        smlad   r4, r9, r7, r4
        smlad   r5, r10, r7, r5
        smlad   r6, r11, r7, r6

        @ upper halves of two units in a word, negative ones to zero
        pkhtb   r1, r2, r1, asr #16
        pkhtb   r2, r4, r3, asr #16
        pkhtb   r3, r6, r5, asr #16
        usat16  r1, #15, r1
        usat16  r2, #15, r2
        usat16  r3, #15, r3

        ldr     r12, [sp, #.Lhae_i_SUMS]
        vmov    lr, s15
        cmp     lr, #4
        bne     5f

        @ four outputs
        ldmia   r0!, {r6-r11}
        ldrd    r4, r5, [r12, #0]
        smlald  r4, r5, r6, r1
        smlald  r4, r5, r7, r2
        smlald  r4, r5, r8, r3
        strd    r4, r5, [r12, #0]
        ldrd    r4, r5, [r12, #8]
        smlald  r4, r5, r9, r1
        smlald  r4, r5, r10, r2
        smlald  r4, r5, r11, r3
        strd    r4, r5, [r12, #8]
        ldmia   r0!, {r6-r11}
        ldrd    r4, r5, [r12, #16]
        smlald  r4, r5, r6, r1
        smlald  r4, r5, r7, r2
        smlald  r4, r5, r8, r3
        strd    r4, r5, [r12, #16]
        ldrd    r4, r5, [r12, #24]
        smlald  r4, r5, r9, r1
        smlald  r4, r5, r10, r2
        smlald  r4, r5, r11, r3
        strd    r4, r5, [r12, #24]
4:      vmov    r4, s14
        cmp     r0, r4
        bne     3b
        b       6f

5:      @ any number of outputs
        ldmia   r0!, {r6-r8}
        ldrd    r4, r5, [r12]
        smlald  r4, r5, r6, r1
        smlald  r4, r5, r7, r2
        smlald  r4, r5, r8, r3
        strd    r4, r5, [r12], #8
        subs    lr, #1
        bne     5b
        b       4b

6:      @ sums to counts
        ldrd    r1, r2, [sp, #.Lhae_i_SUMS]     @ sums, y
        vmov    r3, s15
        vmov    r6, s13                 @ factors
        add     r7, r6, r3, lsl #2      @ biases
7:      ldrd    r4, r5, [r1], #8
        lsrs    r4, r4, #8
        orr     r4, r4, r5, lsl #24
        vmov    s0, r4
        vcvt.f32.s32 s0, s0
        vldmia  r6!, {s1}
        vldmia  r7!, {s2}
        vmul.f32 s0, s0, s1
        vadd.f32 s0, s0, s2
        vstmia  r2!, {s0}
        subs    r3, #1
        bne     7b

        add     sp, #.Lhae_i_FRAME
        pop     {r4-r11, pc}
        .size   hae_m4f_i16, . - hae_m4f_i16
